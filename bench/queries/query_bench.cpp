#include <algorithm>
#include <cmath>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include <benchmark/benchmark.h>

#include "item_reporter.hpp"
#include "queries/query_load.hpp"
#include "queries/query_scene.hpp"
#include "telemetry/clock.hpp"

// Benchmarks query/<kind>/<n>/<impl>: 10,000 queries about n moving objects of mixed shapes (rays of 50 m, sweeps of a
// ball of 0.5 m by 10 m, overlaps of a ball of 5 m, the nearest object within 20 m), with what it takes to prepare them
// after all objects have moved; and query/static_rays/64000/<impl>: a million rays about static boxes and meshes. One
// thread. `update_ms` and `ask_ms` are the medians of the two parts, `least_...` their least times, which other work on
// the machine disturbs least. Before the timing the answers are compared with
// ours: `differ` is the share of queries, or of objects found, that differ; with too many the benchmark fails.

namespace ringfence::bench {
namespace {

struct Implementation {
  const char* name;
  double allowed_difference;
  std::function<std::unique_ptr<QueryTester>(const QueryScene&)> make;
};

/// One kind of queries.
struct Kind {
  const char* name;
  std::optional<Ask> ask;  ///< none: static rays
  std::vector<Implementation> implementations;
};

std::vector<Kind> kinds() {
  // Bullet computes in float, ignores objects that contain the start of a ray, and its casts end early; FCL's tests of
  // hulls have a tolerance.
  constexpr double bullet = 0.12, fcl = 0.03, embree = 0.001;
  (void)bullet, (void)fcl, (void)embree;
  const Implementation ours{"ringfence", 0, make_ringfence_queries};
  std::vector<Kind> out = {{"rays", Ask::rays, {ours}},
                           {"sweeps", Ask::sweeps, {ours}},
                           {"overlaps", Ask::overlaps, {ours}},
                           {"nearest", Ask::nearest, {ours}},
                           {"static_rays", std::nullopt, {ours}}};
#ifdef RINGFENCE_BENCH_EMBREE
  for (std::size_t i = 0; i < 3; ++i) {
    for (const bool refit : {false, true}) {
      out[i].implementations.push_back({refit ? "embree_refit" : "embree", embree, [refit](const QueryScene& scene) {
                                          return make_embree_queries(scene, refit);
                                        }});
    }
  }
  out[4].implementations.push_back({"embree", embree, make_embree_triangles});
#endif
#ifdef RINGFENCE_BENCH_BULLET
  for (std::size_t i = 0; i < 3; ++i) out[i].implementations.push_back({"bullet", bullet, make_bullet_queries});
#endif
#ifdef RINGFENCE_BENCH_FCL
  for (std::size_t i = 2; i < 4; ++i) out[i].implementations.push_back({"fcl", fcl, make_fcl_queries});
#endif
  return out;
}

// The scenes are large. The implementations run one after the other and share a scene, so only the last one is kept.
const QueryScene& scene_of(const Kind& kind, std::uint32_t objects) {
  static std::string current;
  static QueryScene scene;
  const std::string wanted = kind.name + std::to_string(objects);
  if (current != wanted) {
    scene = {};
    scene = kind.ask ? make_moving_scene(objects, *kind.ask) : make_static_scene();
    current = wanted;
  }
  return scene;
}

/// What an implementation finds. Not all members are used for each kind.
struct Answers {
  std::vector<FirstAnswer> first;
  std::size_t found = 0;
};

void ask(const QueryScene& scene, QueryTester& tester, Answers& out) {
  out.first.resize(scene.rays.size() + scene.sweeps.size() + scene.nearest.size());
  if (!scene.rays.empty()) tester.cast(out.first);
  if (!scene.sweeps.empty()) tester.sweep(out.first);
  if (!scene.nearest.empty()) tester.find_nearest(out.first);
  if (!scene.overlaps.empty()) out.found = tester.overlap();
}

/// The share of answers that differ. Queries that start inside an object do not count.
double difference(const Answers& ours, const Answers& theirs) {
  if (ours.first.empty()) {
    const auto both = static_cast<double>(std::max<std::size_t>(1, ours.found));
    return std::abs(static_cast<double>(ours.found) - static_cast<double>(theirs.found)) / both;
  }
  std::size_t differ = 0;
  for (std::size_t i = 0; i < ours.first.size(); ++i) {
    const FirstAnswer &p = ours.first[i], &q = theirs.first[i];
    if (p.object != 0 && p.place == 0) continue;
    if ((p.object == 0) != (q.object == 0) || std::abs(p.place - q.place) > 1e-3) ++differ;
  }
  return static_cast<double>(differ) / static_cast<double>(ours.first.size());
}

double median_ms(std::vector<std::uint64_t>& times) {
  std::sort(times.begin(), times.end());
  return telemetry::to_ms(times[times.size() / 2]);
}

void run(benchmark::State& state, const Kind& kind, std::uint32_t objects, const Implementation& implementation) {
  const QueryScene& scene = scene_of(kind, objects);
  const std::unique_ptr<QueryTester> tester = implementation.make(scene);
  Answers answers;
  double differ = 0;
  {
    const std::unique_ptr<QueryTester> reference = make_ringfence_queries(scene);
    for (QueryTester* one : {reference.get(), tester.get()}) {
      one->move(scene.frames[0]);
      one->update(scene.frames[0]);
    }
    Answers expected;
    ask(scene, *reference, expected);
    ask(scene, *tester, answers);
    differ = difference(expected, answers);
  }
  if (differ > implementation.allowed_difference) {
    state.SkipWithError((std::to_string(100 * differ) + " % of the answers differ").c_str());
    return;
  }
  std::vector<std::uint64_t> updates, asks;
  std::size_t frame = 0;
  const std::size_t period = std::max<std::size_t>(1, 2 * scene.frames.size() - 2);
  for (auto _ : state) {
    const std::size_t at = ++frame % period;
    const std::vector<Pose>& poses = scene.frames[at < scene.frames.size() ? at : period - at];
    state.PauseTiming();
    if (kind.ask) tester->move(poses);
    state.ResumeTiming();
    const std::uint64_t start = telemetry::now_ns();
    if (kind.ask) tester->update(poses);
    const std::uint64_t updated = telemetry::now_ns();
    ask(scene, *tester, answers);
    updates.push_back(updated - start);
    asks.push_back(telemetry::now_ns() - updated);
  }
  using benchmark::Counter;
  const std::size_t queries = std::max(answers.first.size(), scene.overlaps.size());
  const auto hits = std::count_if(answers.first.begin(), answers.first.end(),
                                  [](const FirstAnswer& answer) { return answer.object != 0; });
  state.counters["differ"] = differ;
  state.counters["found"] =
      static_cast<double>(scene.overlaps.empty() ? static_cast<std::size_t>(hits) : answers.found);
  state.counters["update_ms"] = median_ms(updates);
  state.counters["ask_ms"] = median_ms(asks);
  state.counters["least_update_ms"] = telemetry::to_ms(updates.front());  // sorted by median_ms()
  state.counters["least_ask_ms"] = telemetry::to_ms(asks.front());
  state.counters["s/query"] =
      Counter(static_cast<double>(queries), Counter::kIsIterationInvariantRate | Counter::kInvert);
}

}  // namespace
}  // namespace ringfence::bench

int main(int argc, char** argv) {
  using namespace ringfence::bench;
  benchmark::Initialize(&argc, argv);
  if (benchmark::ReportUnrecognizedArguments(argc, argv)) return 2;
  static const std::vector<Kind> all = kinds();
  for (const Kind& kind : all) {
    for (const std::uint32_t objects : {4000u, 64000u}) {
      if (!kind.ask && objects != 64000) continue;
      for (const Implementation& implementation : kind.implementations) {
        const std::string name =
            std::string("query/") + kind.name + '/' + std::to_string(objects) + '/' + implementation.name;
        auto* bench = benchmark::RegisterBenchmark(
            name.c_str(),
            [&kind, &implementation, objects](benchmark::State& state) { run(state, kind, objects, implementation); });
        bench->Unit(benchmark::kMillisecond);
      }
    }
  }
  register_query_loads();
  return run_benchmarks();
}
