#include <algorithm>
#include <chrono>
#include <cstdio>
#include <functional>
#include <map>
#include <memory>
#include <numeric>
#include <string>

#include <benchmark/benchmark.h>

#include "item_reporter.hpp"
#include "narrow_phase/crowd.hpp"
#include "narrow_phase/narrow_phase.hpp"
#include "narrow_phase/peer.hpp"
#include "narrow_phase/targets.hpp"
#include "narrow_phase/world_pairs.hpp"

// Benchmarks narrow/<kind_a>_<kind_b>/<impl>[/<variant>]: ns per candidate pair, one thread, all implementations on the
// same candidates of the same crowd. Variants: none, the mix that a broad phase produces; hits and misses, only those;
// cold, with the second-level cache emptied before each round; few, ringfence in calls of four pairs; ringfence on each
// available instruction set; moving, ringfence in a sequence of frames; moving/forgetful, the same without the cache of
// separating axes. narrow/crate_crate: hulls that lie on each other, all in contact. Before a crowd is timed, the
// implementations are checked to agree on the contacts. narrow/world/<pairs>/ringfence: all candidates, or those of two
// kinds, of frames of the paper's world, in the order and with the cache misses that a node has.

namespace {

using namespace ringfence;
using namespace ringfence::narrow_phase_bench;

/// Large meshes take so long that few pairs are enough.
std::size_t crowd_objects(const Side& a, const Side& b) {
  const int triangles = std::max(a.triangles(), b.triangles());
  return triangles < 1000 ? 4000 : triangles < 10'000 ? 1000 : 200;
}
constexpr std::uint64_t seed = 1;

struct Implementation {
  const char* name;
  std::unique_ptr<Peer> (*make)(const Crowd&);
  enum class Meshes { no, too, only } meshes;

  bool tests(const Side& a, const Side& b) const {
    const bool any = a.kind == ShapeKind::mesh || b.kind == ShapeKind::mesh;
    return any ? meshes != Meshes::no : meshes != Meshes::only;
  }
};

constexpr Implementation implementations[] = {
    {"ringfence", make_ringfence, Implementation::Meshes::too},
#ifdef RINGFENCE_BENCH_FCL
    {"fcl", make_fcl, Implementation::Meshes::too},
    {"fcl_first", make_fcl_first, Implementation::Meshes::only},
#endif
#ifdef RINGFENCE_BENCH_BULLET
    {"bullet", make_bullet, Implementation::Meshes::no},
#endif
    {"libccd", make_libccd, Implementation::Meshes::no},
};

/// A crowd, the implementations that test it, and which of its candidates are in contact.
struct Comparison {
  Crowd crowd;
  std::map<std::string, std::unique_ptr<Peer>> peers;
  std::vector<std::uint32_t> all, hits, misses;
};

/// Share of the candidates on which a peer may differ: contacts within the tolerance of the peer.
constexpr double allowed_difference = 0.01;

/// On the heap, since the peers refer to the crowd.
std::unique_ptr<Comparison> make_comparison(const Side& a, const Side& b) {
  auto result = std::make_unique<Comparison>();
  Comparison& comparison = *result;
  comparison.crowd =
      a.lies ? make_crates(a, crowd_objects(a, b) / 2, seed) : make_crowd(a, b, crowd_objects(a, b), seed);
  comparison.all.resize(comparison.crowd.pairs.size());
  std::iota(comparison.all.begin(), comparison.all.end(), 0u);
  std::vector<std::uint8_t> expected;
  for (const Implementation& implementation : implementations) {
    if (!implementation.tests(a, b)) continue;
    auto peer = implementation.make(comparison.crowd);
    peer->select(comparison.all);
    peer->test();
    const std::span<const std::uint8_t> touches = peer->touches();
    if (expected.empty()) {
      expected.assign(touches.begin(), touches.end());
    }
    std::size_t different = 0;
    for (std::size_t i = 0; i < touches.size(); ++i) different += touches[i] != expected[i];
    if (static_cast<double>(different) > allowed_difference * static_cast<double>(touches.size())) {
      std::fprintf(stderr, "narrow/%s_%s: %s differs from ringfence on %zu of %zu candidates\n", a.name().c_str(),
                   b.name().c_str(), implementation.name, different, touches.size());
      continue;
    }
    comparison.peers.emplace(implementation.name, std::move(peer));
  }
  for (const std::uint32_t pair : comparison.all)
    (expected[pair] ? comparison.hits : comparison.misses).push_back(pair);
  return result;
}

/// Comparisons are created on first use, so that a filter prepares only what it runs. Only the last one is kept.
Comparison& comparison_of(const Side& a, const Side& b) {
  static std::string name;
  static std::unique_ptr<Comparison> comparison;
  const std::string requested = a.name() + '_' + b.name();
  if (requested != name) {
    comparison.reset();
    comparison = make_comparison(a, b);
    name = requested;
  }
  return *comparison;
}

enum class Variant { mix, hits, misses, cold, few };
constexpr const char* suffixes[] = {"", "/hits", "/misses", "/cold", "/few"};

/// Writes more data than the second-level cache holds.
void empty_cache() {
  static std::vector<char> memory(16u << 20);
  for (std::size_t i = 0; i < memory.size(); i += 64) ++memory[i];
  benchmark::ClobberMemory();
}

/// Number of pairs that are timed at once: short enough that other processes leave some rounds of it undisturbed.
constexpr std::size_t slice_pairs = 512;

/// Reports the time of all slices as manual time, and two figures per candidate: the mean, and the sum over the slices
/// of the least time of any round, which other processes disturb less.
void measure(benchmark::State& state, std::span<const std::uint32_t> pairs, bool cold,
             const std::function<void(std::span<const std::uint32_t>)>& prepare, const std::function<void()>& run) {
  using Nanoseconds = std::chrono::duration<double, std::nano>;
  const std::size_t slices = (pairs.size() + slice_pairs - 1) / slice_pairs;
  std::vector<Nanoseconds> least(slices, Nanoseconds::max());
  Nanoseconds total{0};
  for (auto _ : state) {
    Nanoseconds round{0};
    for (std::size_t i = 0; i < slices; ++i) {
      prepare(pairs.subspan(i * slice_pairs, std::min(slice_pairs, pairs.size() - i * slice_pairs)));
      if (cold) empty_cache();
      const auto begin = std::chrono::steady_clock::now();
      run();
      const Nanoseconds slice = std::chrono::steady_clock::now() - begin;
      least[i] = std::min(least[i], slice);
      round += slice;
    }
    state.SetIterationTime(std::chrono::duration<double>(round).count());
    total += round;
  }
  const auto candidates = static_cast<double>(pairs.size());
  state.counters["ns_per_candidate"] = total.count() / static_cast<double>(state.iterations()) / candidates;
  state.counters["least_ns_per_candidate"] =
      std::accumulate(least.begin(), least.end(), Nanoseconds{0}).count() / candidates;
  state.counters["candidates"] = candidates;
}

/// Measures ringfence in calls of four pairs.
void measure_few(benchmark::State& state, const Comparison& comparison) {
  narrow_phase::NarrowPhase narrow_phase(*comparison.crowd.shapes);
  std::span<const geometry::CandidatePair> slice;
  const auto prepare = [&](std::span<const std::uint32_t> pairs) {
    slice = std::span(comparison.crowd.pairs).subspan(pairs.front(), pairs.size());
  };
  std::size_t hits = 0;
  measure(state, comparison.all, false, prepare, [&] {
    for (std::size_t i = 0; i < slice.size(); i += 4) {
      hits += narrow_phase.test(comparison.crowd.bodies, slice.subspan(i, std::min<std::size_t>(4, slice.size() - i)))
                  .size();
    }
  });
  benchmark::DoNotOptimize(hits);
}

/// Measures ringfence in a sequence of frames with moving objects; every round starts with an empty axis cache.
void measure_moving(benchmark::State& state, const Side& a, const Side& b, bool remember) {
  const Comparison& comparison = comparison_of(a, b);
  const std::vector<Frame> frames = make_frames(comparison.crowd, 40, seed + 1);
  narrow_phase::NarrowPhase narrow_phase(*comparison.crowd.shapes);
  narrow_phase.remember_axes(remember);
  using Nanoseconds = std::chrono::duration<double, std::nano>;
  std::vector<Nanoseconds> least(frames.size(), Nanoseconds::max());
  std::size_t candidates = 0, hits = 0;
  for (const Frame& frame : frames) candidates += frame.pairs.size();
  Nanoseconds total{0};
  for (auto _ : state) {
    Nanoseconds round{0};
    narrow_phase.forget_axes();
    narrow_phase.reset_counters();
    for (std::size_t i = 0; i < frames.size(); ++i) {
      const auto begin = std::chrono::steady_clock::now();
      hits += narrow_phase.test(frames[i].bodies, frames[i].pairs).size();
      const Nanoseconds time = std::chrono::steady_clock::now() - begin;
      least[i] = std::min(least[i], time);
      round += time;
    }
    state.SetIterationTime(std::chrono::duration<double>(round).count());
    total += round;
  }
  const auto all = static_cast<double>(candidates), rounds = static_cast<double>(state.iterations());
  const auto early = static_cast<double>(narrow_phase.counters(a.kind, b.kind).ended_early);
  state.counters["ns_per_candidate"] = total.count() / rounds / all;
  state.counters["least_ns_per_candidate"] = std::accumulate(least.begin(), least.end(), Nanoseconds{0}).count() / all;
  state.counters["candidates"] = all;
  state.counters["share_of_hits"] = static_cast<double>(hits) / rounds / all;
  state.counters["ended_early"] = early / all;
}

void run_peer(benchmark::State& state, const Side& a, const Side& b, const std::string& name, Variant variant,
              const std::string& target) {
  Comparison& comparison = comparison_of(a, b);
  const auto found = comparison.peers.find(name);
  if (found == comparison.peers.end()) {
    state.SkipWithError("disagrees on which pairs touch");
    return;
  }
  Peer& peer = *found->second;
  narrow_phase::force_target(target);
  if (variant == Variant::few) {
    measure_few(state, comparison);
  } else {
    const std::vector<std::uint32_t>& pairs = variant == Variant::hits     ? comparison.hits
                                              : variant == Variant::misses ? comparison.misses
                                                                           : comparison.all;
    const auto prepare = [&](std::span<const std::uint32_t> slice) { peer.select({slice.begin(), slice.end()}); };
    measure(state, pairs, variant == Variant::cold, prepare, [&] { peer.test(); });
  }
  narrow_phase::force_target("");
  const double share = static_cast<double>(comparison.hits.size()) / static_cast<double>(comparison.all.size());
  state.counters["share_of_hits"] = variant == Variant::hits ? 1.0 : variant == Variant::misses ? 0.0 : share;
}

void add(const Side& a, const Side& b, const std::string& name, Variant variant, const std::string& target = "") {
  std::string full = "narrow/" + a.name() + '_' + b.name() + '/' + name + suffixes[static_cast<int>(variant)];
  if (!target.empty()) full += '/' + target;
  auto* registered = benchmark::RegisterBenchmark(
      full.c_str(), [=](benchmark::State& state) { run_peer(state, a, b, name, variant, target); });
  registered->UseManualTime();
  // Emptying the cache takes 1000 times as long as the measurement.
  if (variant == Variant::cold) registered->Iterations(40);
}

void add_all(const Side& a, const Side& b) {
  for (const Implementation& implementation : implementations) {
    if (!implementation.tests(a, b)) continue;
    for (const Variant variant : {Variant::mix, Variant::hits, Variant::misses, Variant::cold}) {
      add(a, b, implementation.name, variant);
    }
  }
  add(a, b, "ringfence", Variant::few);
  for (const std::string& target : narrow_phase::targets()) {
    add(a, b, "ringfence", Variant::mix, target);
  }
  if (a.kind != ShapeKind::hull || b.kind != ShapeKind::hull) return;  // only hulls use the axis cache
  for (const bool remember : {true, false}) {
    const std::string name =
        "narrow/" + a.name() + '_' + b.name() + "/ringfence/moving" + (remember ? "" : "/forgetful");
    benchmark::RegisterBenchmark(name.c_str(), [=](benchmark::State& state) {
      measure_moving(state, a, b, remember);
    })->UseManualTime();
  }
}

void add_all_kinds() {
  const Side sphere{ShapeKind::sphere}, box{ShapeKind::box}, capsule{ShapeKind::capsule}, hull{ShapeKind::hull, 32};
  for (const auto& [a, b] : {std::pair{sphere, sphere},
                             {sphere, box},
                             {sphere, capsule},
                             {sphere, hull},
                             {box, box},
                             {box, capsule},
                             {box, hull},
                             {capsule, capsule},
                             {capsule, hull}}) {
    add_all(a, b);
  }
  for (const int frequency : {4, 16, 71}) {
    const Side mesh{ShapeKind::mesh, frequency};
    for (const Side& other : {sphere, box, capsule, hull}) add_all(other, mesh);
    add_all(mesh, mesh);
  }
  const Side crate{ShapeKind::hull, 8, true};
  for (const Implementation& implementation : implementations) {
    if (implementation.tests(crate, crate)) add(crate, crate, implementation.name, Variant::mix);
  }
  for (const int vertices : {8, 16, 32, 64, 128}) add_all({ShapeKind::hull, vertices}, {ShapeKind::hull, vertices});
}

}  // namespace

int main(int argc, char** argv) {
  benchmark::Initialize(&argc, argv);
  if (benchmark::ReportUnrecognizedArguments(argc, argv)) return 1;
  add_all_kinds();
  add_world_pairs();
  return ringfence::bench::run_benchmarks();
}
