# Functions that define modules, tests and benchmarks. A module is a folder of engine/ and an object library, which the
# installed library and the tests of the module share.

add_library(ringfence_options INTERFACE)
target_compile_options(ringfence_options INTERFACE
  -Wall -Wextra -Wpedantic -Wshadow -Wconversion -Wno-sign-conversion
  $<$<BOOL:${RINGFENCE_WERROR}>:-Werror>
  # Results must have the same bits on every machine: no contraction to fused multiply-adds.
  -ffp-contract=off
  # Position-independent code: without this option GCC does not inline a function that a program could replace at run
  # time, that is, any function that other files can call.
  -fno-semantic-interposition)
# The instruction sets that kernels are compiled for must be the same in every file, because functions of Highway that a
# compiler does not inline number them. No SSSE3: a machine without SSE4 uses the plain C++ target, and there is one
# target less to build. AVX3_DL: processors from Ice Lake on look up 64 bytes in one instruction, which the search for
# the edges of a hull uses.
target_compile_definitions(ringfence_options INTERFACE HWY_DISABLED_TARGETS=HWY_SSSE3 HWY_WANT_AVX3_DL)
if(CMAKE_CXX_COMPILER_ID STREQUAL "GNU" AND RINGFENCE_SANITIZE MATCHES "thread")
  # GCC warns that its thread sanitizer does not support fences. tests/link checks the rings exhaustively.
  target_compile_options(ringfence_options INTERFACE -Wno-error=tsan)
endif()
if(CMAKE_CXX_COMPILER_ID STREQUAL "GNU" AND CMAKE_CXX_COMPILER_VERSION VERSION_LESS 13)
  # GCC 12 falsely warns of overlapping copies in the string concatenation of its standard library (bug 105651).
  target_compile_options(ringfence_options INTERFACE -Wno-restrict)
endif()
if(CMAKE_CXX_COMPILER_ID STREQUAL "GNU" AND RINGFENCE_SANITIZE MATCHES "address")
  # With its address sanitizer GCC falsely warns of uninitialised values in <regex> of its standard library (bug 105562).
  target_compile_options(ringfence_options INTERFACE -Wno-maybe-uninitialized)
endif()
if(CMAKE_UNITY_BUILD AND CMAKE_CXX_COMPILER_ID STREQUAL "GNU")
  # GCC takes a type of an included source file for one of a header, which could differ from file to file.
  target_compile_options(ringfence_options INTERFACE -Wno-subobject-linkage)
endif()
if(RINGFENCE_SANITIZE)
  target_compile_options(ringfence_options INTERFACE -fsanitize=${RINGFENCE_SANITIZE} -fno-omit-frame-pointer)
  target_link_options(ringfence_options INTERFACE -fsanitize=${RINGFENCE_SANITIZE})
  if(RINGFENCE_SANITIZE MATCHES "fuzzer-no-link")
    target_compile_options(ringfence_options INTERFACE -ffunction-sections -fdata-sections)
  endif()
  if(RINGFENCE_SANITIZE MATCHES "undefined")
    target_compile_options(ringfence_options INTERFACE -fno-sanitize-recover=undefined)
  endif()
endif()

# ringfence_module(NAME SOURCES... [MODULES module...] [LINK target...])
# MODULES lists the modules whose headers and objects this one uses.
function(ringfence_module name)
  cmake_parse_arguments(ARG "" "" "SOURCES;MODULES;LINK" ${ARGN})
  add_library(ringfence_${name} OBJECT ${ARG_SOURCES})
  target_link_libraries(ringfence_${name} PRIVATE ringfence_options)
  target_compile_options(ringfence_${name} PRIVATE
    "SHELL:-include ${PROJECT_SOURCE_DIR}/engine/base/strict_arithmetic.hpp")
  target_link_libraries(ringfence_${name} PUBLIC ${ARG_LINK})
  target_include_directories(ringfence_${name} PUBLIC ${PROJECT_SOURCE_DIR}/engine/include ${PROJECT_SOURCE_DIR}/engine)
  set_target_properties(ringfence_${name} PROPERTIES POSITION_INDEPENDENT_CODE ON)
  # Kernels are compiled once per SIMD target: the file includes itself, so it cannot be joined with others.
  foreach(source ${ARG_SOURCES})
    cmake_path(ABSOLUTE_PATH source)
    file(STRINGS ${source} once_a_target REGEX "hwy/foreach_target\\.h")
    if(once_a_target)
      set_source_files_properties(${source} PROPERTIES SKIP_UNITY_BUILD_INCLUSION ON)
      if(RINGFENCE_SANITIZE MATCHES "address")
        # They inline everything: the two kernels of boxes took 145 s with -O1 and 13 s with -O0.
        set_source_files_properties(${source} PROPERTIES COMPILE_OPTIONS -O0)
      endif()
    endif()
  endforeach()
  set_property(GLOBAL PROPERTY ringfence_modules_of_${name} "${ARG_MODULES}")
  set_property(GLOBAL PROPERTY ringfence_link_of_${name} "${ARG_LINK}")
  set_property(GLOBAL APPEND PROPERTY ringfence_modules ${name})
endfunction()

# ringfence_compile_unoptimised(TARGET): compiles a target with -O0 under the address and undefined-behaviour sanitizers,
# for code in which a test spends little of its time. With both sanitizers the optimiser is slow: edge.cpp of the gateway,
# which includes Boost.Asio, took 445 s with -O1 and less than 112 s with -O0, a file of tests/facade 22 and 10 s. The checks of
# each pointer before it is used are left out as well; they take a quarter to two fifths of what is left. The address
# sanitizer finds null pointers too, and the preset fuzz has all checks.
function(ringfence_compile_unoptimised target)
  if(RINGFENCE_SANITIZE STREQUAL "address,undefined")
    target_compile_options(${target} PRIVATE -O0 -fno-sanitize=null,alignment,vptr,object-size)
  endif()
endfunction()

# ringfence_closure(OUT module...): sets OUT to the modules and all modules that they need, each once.
function(ringfence_closure out)
  set(todo ${ARGN})
  set(seen)
  while(todo)
    list(POP_FRONT todo module)
    if(NOT module IN_LIST seen)
      list(APPEND seen ${module})
      get_property(more GLOBAL PROPERTY ringfence_modules_of_${module})
      list(APPEND todo ${more})
    endif()
  endwhile()
  set(${out} ${seen} PARENT_SCOPE)
endfunction()

# ringfence_link_modules(TARGET module...): links the objects of the modules and of all modules that they need.
function(ringfence_link_modules target)
  ringfence_closure(modules ${ARGN})
  foreach(module ${modules})
    target_link_libraries(${target} PRIVATE ringfence_${module})
  endforeach()
  target_link_libraries(${target} PRIVATE ringfence_options Threads::Threads)
endfunction()

# Command prefix with which ctest runs each test program.
set(ringfence_test_launcher)
if(RINGFENCE_SANITIZE MATCHES "thread")
  set(ringfence_test_launcher
    ${CMAKE_COMMAND} -E env TSAN_OPTIONS=suppressions=${PROJECT_SOURCE_DIR}/tools/cmake/tsan.supp)
  # GCC's thread sanitizer fails if the kernel maps the program into the range of its shadow memory, which happens with
  # many random address bits. setarch -R disables address randomization.
  execute_process(COMMAND setarch -R true RESULT_VARIABLE setarch_failed OUTPUT_QUIET ERROR_QUIET)
  if(NOT setarch_failed)
    list(APPEND ringfence_test_launcher setarch -R)
  endif()
endif()

# ringfence_test(NAME MODULES module... SOURCES file... [LINK target...] [LABELS label...])
# Defines the doctest program test_NAME, one per folder of tests/, and a ctest test NAME that runs it.
# The target tests_LABEL builds all programs with that label. tools/test runs those with the label `concurrent` also under
# the sanitizers, and those with the label `vectors` under that of addresses and undefined behaviour.
function(ringfence_test name)
  cmake_parse_arguments(ARG "" "" "SOURCES;MODULES;LINK;LABELS" ${ARGN})
  add_executable(test_${name} ${ARG_SOURCES})
  ringfence_link_modules(test_${name} ${ARG_MODULES})
  ringfence_compile_unoptimised(test_${name})
  target_link_libraries(test_${name} PRIVATE ringfence_test_main ${ARG_LINK})
  target_include_directories(test_${name} PRIVATE ${PROJECT_SOURCE_DIR}/tests)
  add_test(NAME ${name} COMMAND ${ringfence_test_launcher} $<TARGET_FILE:test_${name}>)
  set(timeout 900)
  if(RINGFENCE_SANITIZE)
    # Under the thread sanitizer the longest test takes five to ten minutes on two cores.
    set(timeout 1800)
  endif()
  set_tests_properties(${name} PROPERTIES LABELS "${ARG_LABELS}" TIMEOUT ${timeout})
  foreach(label ${ARG_LABELS})
    if(NOT TARGET tests_${label})
      add_custom_target(tests_${label})
    endif()
    add_dependencies(tests_${label} test_${name})
  endforeach()
endfunction()

# ringfence_bench(NAME NAMES prefix... MODULES module... SOURCES file... [LINK target...])
# Defines the benchmark program bench_NAME. The name of each of its benchmarks begins with one of NAMES, so that
# tools/bench builds only the programs that it runs. The target `benchmarks` builds all of them.
function(ringfence_bench name)
  cmake_parse_arguments(ARG "" "" "NAMES;SOURCES;MODULES;LINK" ${ARGN})
  add_executable(bench_${name} ${ARG_SOURCES} ${PROJECT_SOURCE_DIR}/bench/item_reporter.cpp)
  string(JOIN " " prefixes ${ARG_NAMES})
  set_property(GLOBAL APPEND PROPERTY ringfence_bench_programs "program bench_${name} ${prefixes}")
  ringfence_link_modules(bench_${name} ${ARG_MODULES})
  target_link_libraries(bench_${name} PRIVATE benchmark::benchmark fmt::fmt ${ARG_LINK})
  target_include_directories(bench_${name} PRIVATE ${PROJECT_SOURCE_DIR}/bench)
  if(NOT TARGET benchmarks)
    add_custom_target(benchmarks)
  endif()
  add_dependencies(benchmarks bench_${name})
endfunction()

# ringfence_bench_lacks(NAME package...): notes that bench_NAME is built without what needs these packages.
function(ringfence_bench_lacks name)
  string(JOIN " " packages ${ARGN})
  set_property(GLOBAL APPEND PROPERTY ringfence_bench_lacking "lacks bench_${name} ${packages}")
endfunction()
