#include <algorithm>
#include <map>
#include <memory>
#include <string>
#include <vector>

#include <benchmark/benchmark.h>

#include "broad_phase/box_worlds.hpp"
#include "broad_phase/sweep_and_prune.hpp"
#include "item_reporter.hpp"

// Benchmarks broad/<world>/<n>/<impl>: all pairs of a frame, one thread. Before the timing, the pairs of every peer are
// compared with ours in each frame of the world, by their number and by a hash that does not depend on the order.

namespace ringfence::bench {
namespace {

class Ringfence final : public PairFinder {
 public:
  Ringfence(const BoxFrames& world, bool keep_resting)
      : sweep_(world.present.size(), world.present.size(), broad_phase::all_layers_collide(), keep_resting) {}
  const std::vector<geometry::CandidatePair>& pairs() override {
    pairs_.assign(found_.begin(), found_.end());
    return pairs_;
  }
  std::size_t find(const BoxFrames& world, std::size_t frame) override {
    found_ = sweep_.find(world.frames[frame], world.present, world.resting);
    return found_.size();
  }

 private:
  broad_phase::SweepAndPrune sweep_;
  std::span<const geometry::CandidatePair> found_;
  std::vector<geometry::CandidatePair> pairs_;
};

struct Implementation {
  const char* name;
  std::size_t max_boxes;  ///< not run with more boxes, because a frame would take seconds
  PairFinder* (*make)(const BoxFrames& world);
};

const std::vector<Implementation>& implementations() {
  static const std::vector<Implementation> all = {
      {"ringfence", 1000000, [](const BoxFrames& world) -> PairFinder* { return new Ringfence(world, true); }},
      {"ringfence_all", 1000000, [](const BoxFrames& world) -> PairFinder* { return new Ringfence(world, false); }},
#ifdef RINGFENCE_BENCH_EMBREE
      {"embree", 1000000, make_embree},
#endif
#ifdef RINGFENCE_BENCH_CGAL
      {"cgal", 1000000, make_cgal},
#endif
#ifdef RINGFENCE_BENCH_BULLET
      {"bullet", 64000, make_bullet},
#endif
  };
  return all;
}

std::uint64_t mix(std::uint64_t x) {
  x = (x ^ x >> 33) * 0xff51afd7ed558ccd;
  x = (x ^ x >> 33) * 0xc4ceb9fe1a85ec53;
  return x ^ x >> 33;
}

struct PairSet {
  std::size_t count;
  std::uint64_t hash;
  bool operator==(const PairSet&) const = default;
};

PairSet set_of(const std::vector<geometry::CandidatePair>& pairs) {
  std::uint64_t hash = 0;
  for (const auto& p : pairs) hash += mix(std::uint64_t{std::min(p.a, p.b)} << 32 | std::max(p.a, p.b));
  return {pairs.size(), hash};
}

// The worlds are large. The implementations run one after the other and share a world, so only the last world is kept.
const BoxFrames& world_of(const std::string& name, std::size_t boxes) {
  static std::pair<std::string, std::size_t> current;
  static BoxFrames world;
  if (current != std::pair{name, boxes}) {
    world = make_box_world(name, boxes);
    current = {name, boxes};
  }
  return world;
}

void run(benchmark::State& state, const std::string& name, std::size_t boxes, const Implementation& implementation) {
  const BoxFrames& world = world_of(name, boxes);
  const std::unique_ptr<PairFinder> finder(implementation.make(world));
  const std::unique_ptr<PairFinder> ours(implementations().front().make(world));
  std::size_t pairs = 0;
  for (std::size_t frame = 0; frame < world.frames.size(); ++frame) {
    pairs += finder->find(world, frame);
    ours->find(world, frame);
    const PairSet theirs = set_of(finder->pairs());
    if (theirs == set_of(ours->pairs())) continue;
    state.SkipWithError("finds other pairs than ringfence");
    return;
  }
  std::size_t frame = 0;
  for (auto _ : state) {
    benchmark::DoNotOptimize(finder->find(world, frame));
    frame = (frame + 1) % world.frames.size();
  }
  using benchmark::Counter;
  state.counters["pairs"] = static_cast<double>(pairs) / static_cast<double>(world.frames.size());
  state.counters["s/object"] =
      Counter(static_cast<double>(boxes), Counter::kIsIterationInvariantRate | Counter::kInvert);
}

}  // namespace
}  // namespace ringfence::bench

int main(int argc, char** argv) {
  using namespace ringfence::bench;
  benchmark::Initialize(&argc, argv);
  if (benchmark::ReportUnrecognizedArguments(argc, argv)) return 2;
  for (const std::string& world : box_world_names())
    for (const std::size_t boxes : {4000, 16000, 64000, 256000, 1000000})
      for (const Implementation& implementation : implementations()) {
        if (boxes > implementation.max_boxes) continue;
        const std::string name = "broad/" + world + '/' + std::to_string(boxes) + '/' + implementation.name;
        benchmark::RegisterBenchmark(name.c_str(), [=](benchmark::State& state) {
          run(state, world, boxes, implementation);
        })->Unit(benchmark::kMillisecond);
      }
  return run_benchmarks();
}
