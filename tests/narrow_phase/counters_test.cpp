#include <cstdint>
#include <numeric>
#include <span>
#include <string>

#include <doctest/doctest.h>

#include "narrow_phase/mesh_world.hpp"
#include "narrow_phase/pair_world.hpp"
#include "narrow_phase/targets.hpp"

namespace ringfence::narrow_phase_test {
namespace {

using narrow_phase::KindCounters;
using narrow_phase::NarrowPhase;

constexpr ShapeKind kinds[] = {ShapeKind::sphere, ShapeKind::box, ShapeKind::capsule, ShapeKind::hull};

}  // namespace

TEST_CASE("candidates, hits and lanes are counted by kind") {
  const PairWorld world = ordinary_pairs(ShapeKind::capsule, ShapeKind::box, 101, 15);
  NarrowPhase narrow_phase(world.shapes());
  const std::size_t hits = narrow_phase.test(world.bodies, world.pairs).size();
  const KindCounters& counters = narrow_phase.counters(ShapeKind::capsule, ShapeKind::box);
  CHECK(&counters == &narrow_phase.counters(ShapeKind::box, ShapeKind::capsule));
  CHECK(counters.candidates == 101);
  CHECK(counters.hits == hits);
  CHECK(counters.lanes_filled == 101);
  CHECK(counters.lanes >= 101);
  CHECK(counters.lanes < 101 + 32);  // a timed block ends in a separate vector
  CHECK(narrow_phase.counters(ShapeKind::box, ShapeKind::box).candidates == 0);
  narrow_phase.reset_counters();
  CHECK(counters.candidates == 0);
}

TEST_CASE("every kernel counts its filled lanes, and iterative kernels their steps") {
  for (const ShapeKind p : kinds) {
    for (const ShapeKind q : kinds) {
      CAPTURE(name_of(p));
      CAPTURE(name_of(q));
      const PairWorld world = ordinary_pairs(p, q, 200, 16);
      NarrowPhase narrow_phase(world.shapes());
      narrow_phase.test(world.bodies, world.pairs);
      const KindCounters& counters = narrow_phase.counters(p, q);
      CHECK(counters.lanes_filled >= 200);
      CHECK(counters.lanes >= counters.lanes_filled);
      CHECK(counters.lanes < 16 * counters.lanes_filled);
      const bool searches = p == ShapeKind::hull || q == ShapeKind::hull;
      CHECK((counters.iterations >= 200) == searches);
    }
  }
}

TEST_CASE("mesh kernels count their filled lanes and open the same nodes on every target") {
  for (const ShapeKind kind :
       {ShapeKind::sphere, ShapeKind::box, ShapeKind::capsule, ShapeKind::hull, ShapeKind::mesh}) {
    CAPTURE(name_of(kind));
    const PairWorld world = ordinary_mesh_pairs(kind, 200, 20);
    NarrowPhase narrow_phase(world.shapes());
    narrow_phase.test(world.bodies, world.pairs);
    const KindCounters& counters = narrow_phase.counters(kind, ShapeKind::mesh);
    const KindCounters expected = counters;
    CHECK(expected.iterations >= 200);  // at least the root
    CHECK(expected.lanes_filled > expected.iterations);
    for (const std::string& target : narrow_phase::targets()) {
      CAPTURE(target);
      narrow_phase::force_target(target);
      narrow_phase.reset_counters();
      narrow_phase.test(world.bodies, world.pairs);
      CHECK(counters.iterations == expected.iterations);
      CHECK(counters.lanes_filled == expected.lanes_filled);
      CHECK(counters.lanes >= counters.lanes_filled);
      CHECK(counters.lanes < 16 * counters.lanes_filled);
    }
    narrow_phase::force_target("");
  }
}

TEST_CASE("slots of a tree without a node or a triangle do not count as filled lanes") {
  PairWorld world;
  TriangleMesh one;
  one.vertices = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}};
  one.indices = {0, 1, 2};
  world.add_pair(one, {}, Sphere{0.5f}, {{0.2, 0.2, 0.1}, {}});
  world.add_pair(one, {}, one, {{0, 0, 5}, {}});
  world.add_pair(terrain(2, 1, 0), {}, Sphere{0.5f}, {{0, 0, 0.3}, {}});  // 8 triangles: a root and two leaves
  const auto count = [&](std::size_t pair) {
    NarrowPhase narrow_phase(world.shapes());
    narrow_phase.test(world.bodies, std::span(world.pairs).subspan(pair, 1));
    return narrow_phase.counters(pair == 1 ? ShapeKind::mesh : ShapeKind::sphere, ShapeKind::mesh);
  };
  CHECK(count(0).lanes_filled == 1);
  CHECK(count(0).iterations == 2);  // the leaf and the triangle; the other three slots repeat it
  CHECK(count(1).lanes_filled == 1);
  CHECK(count(1).iterations == 1);  // the two leaves; the only pair of triangles is excluded
  CHECK(count(2).lanes_filled == 2 + 8);
}

TEST_CASE("a sample of the candidates is timed for every batch size") {
  for (const ShapeKind p : kinds) {
    CAPTURE(name_of(p));
    const PairWorld world = ordinary_pairs(p, ShapeKind::box, 3000, 17);
    NarrowPhase narrow_phase(world.shapes());
    RandomSource random(18);
    const std::span<const geometry::CandidatePair> pairs = world.pairs;
    for (int call = 0; call < 40; ++call) {
      const auto count = static_cast<std::size_t>(random.logarithmic(1, 3000));
      narrow_phase.test(world.bodies, pairs.first(count));
    }
    const KindCounters& counters = narrow_phase.counters(p, ShapeKind::box);
    CHECK(counters.timed * 100 > counters.candidates);
    CHECK(counters.timed * 20 < counters.candidates);
    CHECK(std::accumulate(std::begin(counters.cost), std::end(counters.cost), std::uint64_t{0}) == counters.timed);
    CHECK(counters.nanoseconds > 0);
    CHECK(counters.gather_nanoseconds > 0);
    CHECK(counters.gather_nanoseconds <= counters.nanoseconds);
    // Both figures are of the same pairs: the bounds of the buckets enclose the sum.
    double low = 0, high = 0;
    for (std::size_t i = 0; i < cost_buckets; ++i) {
      low += i == 0 ? 0 : counters.cost[i] * std::pow(2, static_cast<double>(i) / 2);
      high += counters.cost[i] * (i + 1 == cost_buckets ? 1e12 : std::pow(2, (static_cast<double>(i) + 1) / 2));
    }
    CHECK(static_cast<double>(counters.nanoseconds) >= 0.99 * low);
    CHECK(static_cast<double>(counters.nanoseconds) <= 1.01 * high);
  }
}

TEST_CASE("timing a block changes neither results nor their order") {
  const PairWorld world = ordinary_pairs(ShapeKind::hull, ShapeKind::sphere, 500, 19);
  NarrowPhase narrow_phase(world.shapes());
  const auto first = narrow_phase.test(world.bodies, world.pairs);
  const std::vector<narrow_phase::PairContact> expected(first.begin(), first.end());
  for (int call = 0; call < 10; ++call) {  // 500 is not a multiple of the interval: each call times other pairs
    const auto again = narrow_phase.test(world.bodies, world.pairs);
    REQUIRE(again.size() == expected.size());
    for (std::size_t i = 0; i < again.size(); ++i) {
      REQUIRE(again[i].pair == expected[i].pair);
      REQUIRE(again[i].depth == expected[i].depth);
      REQUIRE(again[i].normal == expected[i].normal);
      REQUIRE(again[i].point == expected[i].point);
    }
  }
}

}  // namespace ringfence::narrow_phase_test
