# Builds and installs the library alone, as docs/install.md shows, where the packages that only tools, tests and
# benchmarks need cannot be found; then the consumer is built against it and runs.
# Arguments: source_dir, build_dir, work_dir, compiler, version, build_type, werror.

cmake_minimum_required(VERSION 3.25)
include(${CMAKE_CURRENT_LIST_DIR}/run.cmake)

# Next to the build folder, so that the compiler cache sees the same relative paths and has the objects already.
set(alone ${build_dir}-library-alone)
file(REMOVE_RECURSE ${work_dir} ${alone})
set(hidden)
foreach(package CLI11 fmt nlohmann_json doctest benchmark CycloneDDS fcl Bullet CGAL embree Boost)
  list(APPEND hidden -D CMAKE_DISABLE_FIND_PACKAGE_${package}=ON)
endforeach()
run(${CMAKE_COMMAND} -G Ninja -S ${source_dir} -B ${alone} -D CMAKE_BUILD_TYPE=${build_type}
  -D CMAKE_CXX_COMPILER=${compiler} -D RINGFENCE_WERROR=${werror} -D RINGFENCE_TOOLS=OFF -D RINGFENCE_TESTS=OFF
  -D RINGFENCE_BENCH=OFF -D RINGFENCE_DDS=OFF -D RINGFENCE_JOURNAL=OFF -D RINGFENCE_GATEWAY=OFF ${hidden})
run(${CMAKE_COMMAND} --build ${alone})
set(prefix ${work_dir}/prefix)
run(${CMAKE_COMMAND} --install ${alone} --prefix ${prefix})
expect_files(${prefix} include/ringfence/world.hpp)
foreach(absent bin include/ringfence/cluster.hpp include/ringfence/gateway.hpp include/ringfence/journal.hpp share/ringfence)
  if(EXISTS ${prefix}/${absent})
    message(FATAL_ERROR "the library alone installs ${absent}")
  endif()
endforeach()

file(COPY ${source_dir}/tests/package/consumer DESTINATION ${work_dir})
file(WRITE ${work_dir}/consumer/every_header.hpp "#pragma once\n")
run(${CMAKE_COMMAND} -G Ninja -S ${work_dir}/consumer -B ${work_dir}/consumer-build -D CMAKE_CXX_COMPILER=${compiler}
  -D CMAKE_PREFIX_PATH=${prefix} -D RINGFENCE_VERSION=${version})
run(${CMAKE_COMMAND} --build ${work_dir}/consumer-build)
run(${work_dir}/consumer-build/consumer)
