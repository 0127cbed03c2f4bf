# Installs everything, moves it, and checks what is there; then the program runs from the new place.
# Arguments: build_dir, work_dir, version, dds, help (whether there are a man page and a completion).

cmake_minimum_required(VERSION 3.25)
include(${CMAKE_CURRENT_LIST_DIR}/run.cmake)

file(REMOVE_RECURSE ${work_dir})
set(prefix ${work_dir}/moved)
run(${CMAKE_COMMAND} --install ${build_dir} --prefix ${work_dir}/first)
file(RENAME ${work_dir}/first ${prefix})

expect_files(${prefix} bin/ringfence include/ringfence/world.hpp share/ringfence/air/NOTICE)
if(help)
  expect_files(${prefix} share/man/man1/ringfence.1 share/bash-completion/completions/ringfence)
endif()
set(has_cluster OFF)
if(EXISTS ${prefix}/include/ringfence/cluster.hpp)
  set(has_cluster ON)
endif()
if(NOT has_cluster STREQUAL dds)
  message(FATAL_ERROR "cluster.hpp installed: ${has_cluster}; library for other processes built: ${dds}")
endif()

run(${prefix}/bin/ringfence --version)
if(NOT output STREQUAL "ringfence ${version}\n")
  message(FATAL_ERROR "--version printed ${output}; expected ringfence ${version}")
endif()
set(air ${prefix}/share/ringfence/air)
run(${prefix}/bin/ringfence replay --scene ${air}/scene.json --motion ${air}/motion.csv --quiet)
if(NOT output MATCHES "\ndigest      bb1603058c04df26\n")
  message(FATAL_ERROR "the installed example has another digest:\n${output}")
endif()
