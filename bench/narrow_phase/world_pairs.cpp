#include "narrow_phase/world_pairs.hpp"

#include <algorithm>
#include <chrono>
#include <cstdint>
#include <numeric>
#include <optional>

#include <benchmark/benchmark.h>

#include "broad_phase/sweep_and_prune.hpp"
#include "facade/recorded_world.hpp"

namespace ringfence::narrow_phase_bench {
namespace {

constexpr std::uint32_t objects = 64000;
constexpr std::size_t frame_count = 4;

/// As many as a node tests in one call.
constexpr std::size_t slice_pairs = 4096;

WorldPairs::Frame frame_of(const bench::RecordedWorld& world, const std::vector<Pose>& poses) {
  WorldPairs::Frame frame;
  std::vector<geometry::Bounds> bounds;
  for (std::size_t i = 0; i < world.objects(); ++i) {
    frame.bodies.push_back({poses[i], world.scene.objects[i].shape.number(), static_cast<ObjectNumber>(i + 1)});
    bounds.push_back(world.shapes->bounds(frame.bodies[i].shape, poses[i], world.space));
  }
  broad_phase::SweepAndPrune sweep(world.objects(), 0);
  const std::vector<std::uint8_t> present(world.objects(), 1), resting(world.objects(), 0);
  for (const geometry::CandidatePair pair : sweep.find(bounds, present, resting)) {
    frame.pairs.push_back({std::min(pair.a, pair.b), std::max(pair.a, pair.b)});
  }
  return frame;
}

struct Kinds {
  ShapeKind first, second;
};

/// The candidates of two kinds, or all candidates.
std::vector<geometry::CandidatePair> pairs_of(const WorldPairs::Frame& frame, const std::optional<Kinds>& kinds) {
  if (!kinds) return frame.pairs;
  const geometry::ShapeTable& shapes = *world_pairs().shapes;
  std::vector<geometry::CandidatePair> pairs;
  for (const geometry::CandidatePair pair : frame.pairs) {
    const auto [first, second] =
        std::minmax(shapes.row(frame.bodies[pair.a].shape).kind, shapes.row(frame.bodies[pair.b].shape).kind);
    if (first == kinds->first && second == kinds->second) pairs.push_back(pair);
  }
  return pairs;
}

void measure_world(benchmark::State& state, const std::optional<Kinds>& kinds) {
  const WorldPairs& world = world_pairs();
  using Nanoseconds = std::chrono::duration<double, std::nano>;
  struct Slice {
    const WorldPairs::Frame* frame;
    std::span<const geometry::CandidatePair> pairs;
    Nanoseconds least = Nanoseconds::max();
  };
  std::vector<std::vector<geometry::CandidatePair>> pairs;
  std::vector<Slice> slices;
  std::size_t candidates = 0, hits = 0;
  for (const WorldPairs::Frame& frame : world.frames) pairs.push_back(pairs_of(frame, kinds));
  for (std::size_t f = 0; f < pairs.size(); ++f) {
    candidates += pairs[f].size();
    for (std::size_t i = 0; i < pairs[f].size(); i += slice_pairs) {
      const std::size_t count = std::min(slice_pairs, pairs[f].size() - i);
      slices.push_back({&world.frames[f], std::span(pairs[f]).subspan(i, count)});
    }
  }
  narrow_phase::NarrowPhase narrow_phase(*world.shapes);
  narrow_phase.remember_axes(true);
  Nanoseconds total{0};
  for (auto _ : state) {
    Nanoseconds round{0};
    for (Slice& slice : slices) {
      const auto begin = std::chrono::steady_clock::now();
      hits += narrow_phase.test(slice.frame->bodies, slice.pairs).size();
      const Nanoseconds time = std::chrono::steady_clock::now() - begin;
      slice.least = std::min(slice.least, time);
      round += time;
    }
    state.SetIterationTime(std::chrono::duration<double>(round).count());
    total += round;
  }
  const auto all = static_cast<double>(candidates), rounds = static_cast<double>(state.iterations());
  const Nanoseconds least = std::accumulate(slices.begin(), slices.end(), Nanoseconds{0},
                                            [](Nanoseconds sum, const Slice& slice) { return sum + slice.least; });
  state.counters["ns_per_candidate"] = total.count() / rounds / all;
  state.counters["least_ns_per_candidate"] = least.count() / all;
  state.counters["least_ms_per_frame"] = least.count() * 1e-6 / static_cast<double>(frame_count);
  state.counters["candidates"] = all / static_cast<double>(frame_count);
  state.counters["share_of_hits"] = static_cast<double>(hits) / rounds / all;
}

}  // namespace

const WorldPairs& world_pairs() {
  static const bench::RecordedWorld recorded = bench::record_world(worlds::ShapeSetting::mixed, objects, frame_count);
  static const WorldPairs world = [] {
    WorldPairs result{recorded.shapes.get(), {}};
    for (const std::vector<Pose>& poses : recorded.frames) result.frames.push_back(frame_of(recorded, poses));
    return result;
  }();
  return world;
}

void add_world_pairs() {
  const auto add = [](const std::string& pairs, std::optional<Kinds> kinds) {
    benchmark::RegisterBenchmark(("narrow/world/" + pairs + "/ringfence").c_str(), [=](benchmark::State& state) {
      measure_world(state, kinds);
    })->UseManualTime();
  };
  add("all", {});
  constexpr ShapeKind kinds[] = {ShapeKind::sphere, ShapeKind::box, ShapeKind::capsule, ShapeKind::hull};
  for (std::size_t q = 0; q < std::size(kinds); ++q) {
    for (std::size_t p = 0; p <= q; ++p) {
      add(std::string(name_of(kinds[p])) + '_' + name_of(kinds[q]), Kinds{kinds[p], kinds[q]});
    }
  }
}

}  // namespace ringfence::narrow_phase_bench
