# Makes the Debian packages and checks what they contain, need and run. tools/package --smoke-test installs them on a
# bare Debian.
# Arguments: build_dir, work_dir, version.

cmake_minimum_required(VERSION 3.25)
include(${CMAKE_CURRENT_LIST_DIR}/run.cmake)

find_program(dpkg_deb dpkg-deb)
find_program(dpkg_shlibdeps dpkg-shlibdeps)
if(NOT dpkg_deb OR NOT dpkg_shlibdeps)
  message("skipped: found no dpkg-dev")
  return()
endif()
file(REMOVE_RECURSE ${work_dir})
run(cpack --config ${build_dir}/CPackConfig.cmake -B ${work_dir} WORKING_DIRECTORY ${build_dir})

# expect_package(NAME dependency...): unpacks the package to work_dir/NAME; its field Depends has all dependencies.
function(expect_package name)
  file(GLOB file ${work_dir}/${name}_${version}_*.deb)
  run(${dpkg_deb} --extract ${file} ${work_dir}/${name})
  run(${dpkg_deb} --field ${file} Depends)
  foreach(dependency ${ARGN})
    if(NOT output MATCHES "${dependency}")
      message(FATAL_ERROR "${name} does not depend on ${dependency}: ${output}")
    endif()
  endforeach()
endfunction()

expect_package(ringfence libc6 libtbb12 libassimp5 libcairo2 libhwy1 libhwloc15 libccd2)
run(${work_dir}/ringfence/usr/bin/ringfence --version)
expect_files(${work_dir}/ringfence/usr/libexec/ringfence ringfence-mesh-reader png.so)
expect_package(libringfence-dev libtbb-dev libccd-dev libhwy-dev libhwloc-dev)
expect_files(${work_dir}/libringfence-dev/usr include/ringfence/world.hpp lib/libringfence.a
  lib/cmake/ringfence/ringfence-config.cmake lib/pkgconfig/ringfence.pc)
