#include <algorithm>
#include <iterator>
#include <memory>
#include <string>
#include <vector>

#include <benchmark/benchmark.h>

#include "facade/frame_implementations.hpp"
#include "facade/memory_bench.hpp"
#include "facade/recorded_world.hpp"
#include "item_reporter.hpp"
#include "telemetry/clock.hpp"

// Benchmarks frame/<shapes>/<n>/<impl>: a whole frame from poses to contacts, with recorded motion of the paper's
// world. frame_at_rest/<shapes>/<n>/<percent>/<impl>: the same where this share of the objects does not move.
// frame_drift/mixed/<n>/<impl>: bodies of other sizes that fly, generated here, so that no run of ours chose the
// motion. Single-threaded implementations report CPU time, those with two threads (..._2) wall time. Before the timing,
// the contacts are compared with those of our own plain loop: the service must agree on every pair, a peer may differ
// in 3 % of the contacts. memory/mixed/<n>/<impl> is in memory_bench.cpp.

namespace ringfence::bench {
namespace {

constexpr std::size_t recorded_frames = 16;

struct Setting {
  worlds::ShapeSetting shapes = worlds::ShapeSetting::mixed;
  std::uint32_t objects = 0;
  std::uint32_t at_rest = 0;  ///< percent
  bool drifts = false;        ///< the world of make_drift_world instead of the paper's
  bool operator==(const Setting&) const = default;
};

std::vector<std::uint64_t> sorted(std::vector<std::uint64_t> keys) {
  std::sort(keys.begin(), keys.end());
  return keys;
}

// The worlds are large. The implementations run one after the other and share a world, so only the last world is kept.
const RecordedWorld& world_of(const Setting& setting) {
  static Setting current;
  static RecordedWorld world;
  if (current != setting) {
    world = setting.drifts ? make_drift_world(setting.objects, recorded_frames)
                           : record_world(setting.shapes, setting.objects, recorded_frames);
    let_rest(world, setting.at_rest);
    current = setting;
  }
  return world;
}

/// Number of pairs that only one of the two reports.
std::size_t differences(const FrameTester& p, const FrameTester& q) {
  std::vector<std::uint64_t> differ;
  const auto first = sorted(p.touching()), second = sorted(q.touching());
  std::set_symmetric_difference(first.begin(), first.end(), second.begin(), second.end(), std::back_inserter(differ));
  return differ.size();
}

void run(benchmark::State& state, const Setting& setting, const Implementation& implementation) {
  const RecordedWorld& world = world_of(setting);
  const std::unique_ptr<FrameTester> tester = implementation.make(world);
  const std::unique_ptr<FrameTester> reference = make_loop_frame(world);
  std::size_t k = 0, differ = 0, touch = 0;
  for (; k < recorded_frames; ++k) {
    tester->run(world.frames[k]);
    if (k % 5 != 0) continue;
    reference->run(world.frames[k]);
    differ += differences(*tester, *reference);
    touch += reference->contacts();
  }
  if (static_cast<double>(differ) > implementation.allowed_difference * static_cast<double>(touch)) {
    state.SkipWithError((std::to_string(differ) + " of " + std::to_string(touch) + " contacts differ").c_str());
    return;
  }
  std::vector<std::uint64_t> times;
  std::size_t contacts = 0;
  for (auto _ : state) {
    const std::uint64_t start = telemetry::now_ns();
    tester->run(world.frames[world.played(k++)]);
    times.push_back(telemetry::now_ns() - start);
    contacts += tester->contacts();
  }
  std::sort(times.begin(), times.end());
  using benchmark::Counter;
  state.counters["contacts"] = static_cast<double>(contacts) / static_cast<double>(times.size());
  state.counters["differ"] = static_cast<double>(differ) / static_cast<double>(std::max<std::size_t>(1, touch));
  state.counters["least_ms"] = telemetry::to_ms(times.front());
  state.counters["median_ms"] = telemetry::to_ms(times[times.size() / 2]);
  state.counters["s/object"] =
      Counter(static_cast<double>(setting.objects), Counter::kIsIterationInvariantRate | Counter::kInvert);
}

void add(const std::string& name, const Setting& setting) {
  for (const Implementation& implementation : frame_implementations()) {
    if (setting.objects > implementation.max_objects) continue;
    auto* bench = benchmark::RegisterBenchmark((name + '/' + implementation.name).c_str(),
                                               [=](benchmark::State& state) { run(state, setting, implementation); });
    bench->Unit(benchmark::kMillisecond);
    if (implementation.threads) bench->UseRealTime();
  }
}

}  // namespace
}  // namespace ringfence::bench

int main(int argc, char** argv) {
  using namespace ringfence::bench;
  using ringfence::worlds::ShapeSetting;
  benchmark::Initialize(&argc, argv);
  if (benchmark::ReportUnrecognizedArguments(argc, argv)) return 2;
  add_memory_benchmarks();
  for (const ShapeSetting shapes :
       {ShapeSetting::sphere, ShapeSetting::box, ShapeSetting::capsule, ShapeSetting::hull, ShapeSetting::mixed}) {
    for (const std::uint32_t objects : {4000u, 64000u, 256000u}) {
      add(std::string("frame/") + name_of(shapes) + '/' + std::to_string(objects), {shapes, objects, 0, false});
    }
  }
  for (const ShapeSetting shapes : {ShapeSetting::mixed, ShapeSetting::hull}) {
    for (const std::uint32_t percent : {30u, 60u, 90u}) {
      add(std::string("frame_at_rest/") + name_of(shapes) + "/64000/" + std::to_string(percent),
          {shapes, 64000, percent, false});
    }
  }
  for (const std::uint32_t objects : {4000u, 64000u, 256000u}) {
    add("frame_drift/mixed/" + std::to_string(objects), {ShapeSetting::mixed, objects, 0, true});
  }
  return run_benchmarks();
}
