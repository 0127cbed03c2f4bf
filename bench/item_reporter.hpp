#pragma once

#include <string>
#include <vector>

#include <benchmark/benchmark.h>

namespace ringfence::bench {

/// Prints one line for each benchmark that begins with the nanoseconds per item, and the kind of item: candidate,
/// object, trip, or round if the benchmark counts no items. Then the time of a round, the number of rounds, the name,
/// and the other counters. Files of --benchmark_out are not affected.
class ItemReporter : public benchmark::BenchmarkReporter {
 public:
  bool ReportContext(const Context& context) override;
  void ReportRuns(const std::vector<Run>& runs) override;
};

/// Runs what the options of Google Benchmark select, with an ItemReporter. The context in files of --benchmark_out also
/// has `cpu_model` and `cpu_governor`, so that results of several machines can stand side by side. Returns the exit
/// code of main.
int run_benchmarks();

}  // namespace ringfence::bench
