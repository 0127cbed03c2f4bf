# Installs everything, moves it, and checks what is there; then the program runs from the new place.
# Arguments: source_dir, build_dir, work_dir, version, dds, help (whether there are a man page and a completion).

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
run(${prefix}/bin/ringfence replay --scene ${air}/scene.json --motion ${air}/motion.csv --quiet
  --picture ${work_dir}/air.png)
if(NOT output MATCHES "\ndigest      bb1603058c04df26\n")
  message(FATAL_ERROR "the installed example has another digest:\n${output}")
endif()
expect_files(${work_dir} air.png)

# The helpers in libexec: PNG pictures were tested above, mesh files here.
file(COPY ${source_dir}/tests/tools/meshes/tetrahedron.ply DESTINATION ${work_dir})
file(WRITE ${work_dir}/scene.json [[{"format": "ringfence-scene", "version": 1,
 "bounds": {"min": [-5, -5, -5], "max": [5, 5, 5]}, "shapes": {"rock": {"type": "mesh", "file": "tetrahedron.ply"}},
 "objects": [{"id": 1, "shape": "rock", "category": "active", "position": [0, 0, 0]}]}]])
file(WRITE ${work_dir}/motion.csv "frame,object,x,y,z,qx,qy,qz,qw\n0,1,0,0,0,0,0,0,1\n")
run(${prefix}/bin/ringfence replay --scene ${work_dir}/scene.json --motion ${work_dir}/motion.csv --quiet)
