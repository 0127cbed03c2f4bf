#include "item_reporter.hpp"

#include <cstdio>
#include <fstream>
#include <ostream>
#include <string_view>

#include <fmt/format.h>

namespace ringfence::bench {
namespace {

using Run = benchmark::BenchmarkReporter::Run;

struct PerItem {
  double nanoseconds;
  std::string item;
  std::string counter;  ///< the counter that has it; empty if there is none
};

/// What follows `key` in the first line that begins with it, without what separates them; empty if there is none.
std::string value_in(const char* file, std::string_view key) {
  std::ifstream lines(file);
  for (std::string line; std::getline(lines, line);) {
    if (!line.starts_with(key)) continue;
    const std::size_t begin = line.find_first_not_of(" \t:", key.size());
    return begin == std::string::npos ? std::string() : line.substr(begin);
  }
  return {};
}

/// Google Benchmark writes the number and the frequency of the processors, but not their model.
void add_machine() {
  benchmark::AddCustomContext("cpu_model", value_in("/proc/cpuinfo", "model name"));
  const std::string governor = value_in("/sys/devices/system/cpu/cpu0/cpufreq/scaling_governor", "");
  benchmark::AddCustomContext("cpu_governor", governor.empty() ? "not known" : governor);
}

double round_ns(const Run& run) {
  return run.GetAdjustedRealTime() * 1e9 / benchmark::GetTimeUnitMultiplier(run.time_unit);
}

/// Counters are called ns_per_candidate, ns_a_trip, s/object or items_per_second.
PerItem per_item(const Run& run) {
  for (const auto& [name, counter] : run.counters) {
    for (const std::string_view prefix : {"ns_per_", "ns_a_"}) {
      if (name.starts_with(prefix)) return {counter.value, name.substr(prefix.size()), name};
    }
    if (name.starts_with("s/")) return {counter.value * 1e9, name.substr(2), name};
  }
  const auto rate = run.counters.find("items_per_second");
  if (rate != run.counters.end() && rate->second.value > 0) return {1e9 / rate->second.value, "item", rate->first};
  return {round_ns(run), "round", ""};
}

std::string others(const Run& run, const std::string& shown) {
  std::string text;
  for (const auto& [name, counter] : run.counters) {
    if (name != shown) text += fmt::format(" {}={:.4g}", name, counter.value);
  }
  return text;
}

}  // namespace

bool ItemReporter::ReportContext(const Context& context) {
  PrintBasicContext(&GetErrorStream(), context);
  fmt::print("{:>12} {:<10} {:>14} {:>10}  {}\n", "ns per item", "item", "ns per round", "rounds", "benchmark");
  return true;
}

void ItemReporter::ReportRuns(const std::vector<Run>& runs) {
  for (const Run& run : runs) {
    if (run.error_occurred) {
      fmt::print("{:>12} {:<10} {:>14} {:>10}  {}: {}\n", "-", "-", "-", "-", run.benchmark_name(), run.error_message);
      continue;
    }
    const PerItem each = per_item(run);
    fmt::print("{:>12.4g} {:<10} {:>14.6g} {:>10}  {}{}\n", each.nanoseconds, each.item, round_ns(run), run.iterations,
               run.benchmark_name(), others(run, each.counter));
  }
  std::fflush(stdout);
}

int run_benchmarks() {
  add_machine();
  ItemReporter reporter;
  benchmark::RunSpecifiedBenchmarks(&reporter);
  benchmark::Shutdown();
  return 0;
}

}  // namespace ringfence::bench
