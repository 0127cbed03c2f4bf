# Builds the consumer by one method (find_package, pkg_config or add_subdirectory) and runs it.
# Arguments: method, source_dir, build_dir, work_dir, compiler, version, dds (whether the library for CD nodes in other
# processes was built).

cmake_minimum_required(VERSION 3.25)
include(${CMAKE_CURRENT_LIST_DIR}/run.cmake)

# Options with which the library is compiled must not appear in the consumer's compile commands.
function(expect_no_leak commands)
  foreach(ours -ffp-contract -Werror -Wconversion -fsanitize HWY_)
    if(commands MATCHES "${ours}")
      message(FATAL_ERROR "${ours} leaks to the consumer:\n${commands}")
    endif()
  endforeach()
endfunction()

file(REMOVE_RECURSE ${work_dir})
set(prefix ${work_dir}/prefix)
if(method STREQUAL "add_subdirectory")
  set(headers ${source_dir}/engine/include)
  set(dds OFF)
else()
  # Install to one path and use it from another: the package must be relocatable.
  run(${CMAKE_COMMAND} --install ${build_dir} --prefix ${work_dir}/first --component development)
  file(RENAME ${work_dir}/first ${prefix})
  set(headers ${prefix}/include)
endif()

file(GLOB public RELATIVE ${headers} ${headers}/ringfence/*.hpp)
list(REMOVE_ITEM public ringfence/eigen.hpp)  # the only header that requires Eigen
set(includes)
foreach(header ${public})
  string(APPEND includes "#include <${header}>\n")
endforeach()
file(COPY ${source_dir}/tests/package/consumer DESTINATION ${work_dir})
file(WRITE ${work_dir}/consumer/every_header.hpp "#pragma once\n${includes}")

if(method STREQUAL "pkg_config")
  file(GLOB_RECURSE module ${prefix}/*/ringfence.pc)
  cmake_path(GET module PARENT_PATH module_dir)
  set(ENV{PKG_CONFIG_PATH} ${module_dir})
  run(pkg-config --exact-version=${version} --print-errors ringfence)
  run(sh -c "${compiler} -std=c++20 -Wall -Wextra -Wconversion -Werror consumer/main.cpp \
    $(pkg-config --cflags --libs ringfence) -o consumer/consumer" WORKING_DIRECTORY ${work_dir})
  run(${work_dir}/consumer/consumer)
  if(dds)
    run(sh -c "${compiler} -std=c++20 consumer/cluster.cpp \
      $(pkg-config --cflags --libs ringfence-dds) -o consumer/cluster" WORKING_DIRECTORY ${work_dir})
    run(${work_dir}/consumer/cluster)
  endif()
  return()
endif()

if(method STREQUAL "add_subdirectory")
  set(where -D RINGFENCE_SOURCE_DIR=${source_dir})
else()
  set(where -D CMAKE_PREFIX_PATH=${prefix} -D RINGFENCE_VERSION=${version})
endif()
run(${CMAKE_COMMAND} -G Ninja -S ${work_dir}/consumer -B ${work_dir}/build -D CMAKE_BUILD_TYPE=Release
  -D CMAKE_CXX_COMPILER=${compiler} ${where})
run(ninja -C ${work_dir}/build -t commands CMakeFiles/consumer.dir/main.cpp.o)
expect_no_leak("${output}")

if(method STREQUAL "add_subdirectory")
  # Build only the consumer's own source: the library would be built a second time.
  run(ninja -C ${work_dir}/build CMakeFiles/consumer.dir/main.cpp.o)
  run(ninja -C ${work_dir}/build -t targets all)
  if(output MATCHES "(test|bench)_[a-z]+:|/worlds/")
    message(FATAL_ERROR "A project that adds the library as a subdirectory also builds tests, benchmarks or tools:\n${output}")
  endif()
else()
  run(ninja -C ${work_dir}/build)
  run(${work_dir}/build/consumer)
  if(dds)
    run(${work_dir}/build/cluster)
  endif()
endif()
