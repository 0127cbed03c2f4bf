#include <benchmark/benchmark.h>

#include "item_reporter.hpp"
#include "link/benches.hpp"

int main(int count, char** arguments) {
  ringfence::bench::register_rings();
  ringfence::bench::register_doorbells();
  ringfence::bench::register_messages();
  benchmark::Initialize(&count, arguments);
  if (benchmark::ReportUnrecognizedArguments(count, arguments)) return 2;
  return ringfence::bench::run_benchmarks();
}
