# run(COMMAND ARGUMENT... [WORKING_DIRECTORY folder]): runs a command and sets `output`. Ends the test if it fails.
function(run)
  execute_process(COMMAND ${ARGN} RESULT_VARIABLE result OUTPUT_VARIABLE output ERROR_VARIABLE output)
  if(result)
    list(JOIN ARGN " " command)
    message("${output}")
    message(FATAL_ERROR "${result} from: ${command}")
  endif()
  set(output "${output}" PARENT_SCOPE)
endfunction()

# expect_files(FOLDER file...): every file exists below the folder.
function(expect_files folder)
  foreach(file ${ARGN})
    if(NOT EXISTS ${folder}/${file})
      message(FATAL_ERROR "${folder} has no ${file}")
    endif()
  endforeach()
endfunction()
