# Builds the examples against an installed library, as README.md does, and runs the first.
# Arguments: source_dir, build_dir, work_dir, compiler.

cmake_minimum_required(VERSION 3.25)
include(${CMAKE_CURRENT_LIST_DIR}/run.cmake)

file(REMOVE_RECURSE ${work_dir})
run(${CMAKE_COMMAND} --install ${build_dir} --prefix ${work_dir}/prefix)
run(${CMAKE_COMMAND} -G Ninja -S ${source_dir}/docs/examples -B ${work_dir}/build
  -D CMAKE_CXX_COMPILER=${compiler} -D CMAKE_PREFIX_PATH=${work_dir}/prefix)
run(${CMAKE_COMMAND} --build ${work_dir}/build)
run(${work_dir}/build/first_frame)
if(NOT output STREQUAL "1 and 2 overlap by 0.25 m\n")
  message(FATAL_ERROR "first_frame prints\n${output}")
endif()
