# Checks that tools/compare-bench reports exactly the benchmarks that became slower, for all time units and repetitions.
# Arguments: script, python, work_dir.
cmake_minimum_required(VERSION 3.25)

# write(FILE "NAME TIME UNIT" ...): writes a result file in the format of Google Benchmark, with the variable `context`.
function(write file)
  set(runs)
  foreach(run ${ARGN})
    separate_arguments(run)
    list(GET run 0 name)
    list(GET run 1 time)
    list(GET run 2 unit)
    list(APPEND runs "{\"name\": \"${name}\", \"run_name\": \"${name}\", \"run_type\": \"iteration\", \
\"real_time\": ${time}, \"cpu_time\": ${time}, \"time_unit\": \"${unit}\"}")
  endforeach()
  list(JOIN runs "," runs)
  file(WRITE ${file} "{\"context\": {${context}}, \"benchmarks\": [${runs}]}")
endfunction()

function(expect code pattern)
  execute_process(COMMAND ${python} ${script} ${ARGN} RESULT_VARIABLE result OUTPUT_VARIABLE output
    ERROR_VARIABLE output)
  if(NOT result EQUAL code OR NOT output MATCHES "${pattern}")
    message(FATAL_ERROR "compare-bench ${ARGN}: expected exit code ${code} and '${pattern}', got ${result}:\n${output}")
  endif()
endfunction()

file(REMOVE_RECURSE ${work_dir})
write(${work_dir}/old/one.json "narrow/a 100 ns" "narrow/b 2 us" "narrow/gone 5 ns")
# The median of three repetitions counts, not the slowest or the fastest.
write(${work_dir}/new/one.json "narrow/a 900 ns" "narrow/a 104 ns" "narrow/a 50 ns" "narrow/b 2500 ns")

expect(0 "3 compared, 0 slower, 0 faster" ${work_dir}/old/one.json ${work_dir}/old/one.json)
expect(1 "SLOWER.*1\\.25 x  narrow/b\n" ${work_dir}/old/one.json ${work_dir}/new/one.json)
expect(1 "only in old: narrow/gone\n2 compared, 1 slower, 0 faster" ${work_dir}/old ${work_dir}/new)
expect(0 "2 compared, 0 slower, 0 faster" ${work_dir}/old ${work_dir}/new --threshold 30)
expect(0 "faster.*narrow/b\n" ${work_dir}/new ${work_dir}/old)
set(context "\"cpu_model\": \"Abacus 1\"")
write(${work_dir}/abacus.json "narrow/a 100 ns")
set(context "\"cpu_model\": \"Abacus 2\"")
write(${work_dir}/other.json "narrow/a 100 ns")
expect(0 "different processors: Abacus 1; Abacus 2\\." ${work_dir}/abacus.json ${work_dir}/other.json)
expect(0 "^1 compared" ${work_dir}/abacus.json ${work_dir}/abacus.json)
expect(0 "^only in old" ${work_dir}/old/one.json ${work_dir}/abacus.json)
file(WRITE ${work_dir}/broken.json "{")
expect(2 "broken.json: not a result" ${work_dir}/old ${work_dir}/broken.json)
