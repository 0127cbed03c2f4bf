# Checks that one source file of each module does not compile if -ffast-math is added to its compile command. Checks for
# a file of base that it does not compile with related options either, and that it compiles without them.
# Arguments: engine, build_dir, modules (comma separated).

cmake_minimum_required(VERSION 3.25)
set(commands ${build_dir}/compile_commands.json)
if(NOT EXISTS ${commands})
  message("compile_commands.json is missing: configure with CMAKE_EXPORT_COMPILE_COMMANDS=ON")
  return()
endif()

function(compile command option)
  execute_process(COMMAND sh -c "${command} ${option} -fsyntax-only -Wfatal-errors" WORKING_DIRECTORY ${build_dir}
    RESULT_VARIABLE result OUTPUT_VARIABLE output ERROR_VARIABLE output)
  set(result "${result}" PARENT_SCOPE)
  set(output "${output}" PARENT_SCOPE)
endfunction()

string(REPLACE "," ";" modules "${modules}")
foreach(module ${modules})
  if(NOT IS_DIRECTORY ${engine}/${module})
    continue()  # modules outside engine/ are compiled in the same way
  endif()
  file(STRINGS ${commands} lines REGEX "\"command\": .* -c ${engine}/${module}/[a-z_/]+\\.cpp\"" LIMIT_COUNT 1)
  if(NOT lines MATCHES "\"command\": \"(.*)\"")
    message(FATAL_ERROR "No source file of ${module} is in ${commands}")
  endif()
  string(REPLACE "\\\"" "\"" command "${CMAKE_MATCH_1}")
  set(refused -ffast-math)
  if(module STREQUAL "base")
    list(APPEND refused -Ofast -ffinite-math-only)
    compile("${command}" "")
    if(result)
      message(FATAL_ERROR "A file of ${module} does not compile as it is:\n${output}")
    endif()
  endif()
  foreach(option ${refused})
    compile("${command}" ${option})
    if(NOT result OR NOT output MATCHES "must not be compiled with -ffast-math")
      message(FATAL_ERROR "A file of ${module} is not refused with ${option}: ${result}\n${output}")
    endif()
  endforeach()
endforeach()
