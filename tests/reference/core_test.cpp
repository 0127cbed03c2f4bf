// Compares the methods of the reference with each other: two methods share nothing but the vertices.
#include <algorithm>

#include <doctest/doctest.h>

#include "reference/core_distance.hpp"
#include "reference/core_overlap.hpp"
#include "reference/random_shapes.hpp"
#include "reference/shapes.hpp"

using namespace ringfence;
using namespace ringfence::reference;
using reference_test::Random;

namespace {

/// A core of any kind, including flat ones.
Core any_core(Random& random, double size) {
  if (random.one_in(4)) {
    Core core;
    set_triangle(core, random.direction() * size, random.direction() * size, random.direction() * size);
    return core;
  }
  return core_of(random.convex(size));
}

Placement any_placement(Random& random, double reach) {
  return {rotation_of(random.one_in(3) ? random.square_orientation() : random.orientation()),
          random.one_in(20) ? Vector{} : random.direction() * random.uniform(0, reach)};
}

}  // namespace

TEST_CASE("pruning by arcs gives the least depth of the exhaustive method") {
  const std::uint64_t seed = 11;
  CAPTURE(seed);
  Random random(seed);
  int overlapping = 0;
  for (int i = 0; i < 6000; ++i) {
    CAPTURE(i);
    const double size_b = random.one_in(3) ? random.size(1e-3, 1e3) : 1;
    const Core a = any_core(random, 1), b = any_core(random, size_b);
    const CorePair pair{a, b, any_placement(random, a.reach + b.reach)};
    const CoreOverlap pruned = polytope_overlap(pair), full = exhaustive_overlap(pair);
    if (full.depth < 0) continue;  // for a gap, the greatest gap along a direction is not computed
    ++overlapping;
    CHECK(std::abs(pruned.depth - full.depth) <= 1e-13 * pair.scale());
    CHECK(pair.overlap(pruned.normal) == doctest::Approx(pruned.depth).epsilon(1e-9));
  }
  CHECK(overlapping > 1500);
}

TEST_CASE("the least depth over faces and edges equals that of EPA") {
  for (const std::uint64_t seed : {12u, 107012u}) {  // 107012: slivers whose normals are noise
    CAPTURE(seed);
    Random random(seed);
    int compared = 0;
    for (int i = 0; i < 1500; ++i) {
      CAPTURE(i);
      const double size_b = random.one_in(3) ? random.size(1e-2, 1e2) : 1;
      const Core a = any_core(random, 1), b = any_core(random, size_b);
      const CorePair pair{a, b, any_placement(random, a.reach + b.reach)};
      const CoreOverlap tried = polytope_overlap(pair);
      if (tried.depth < 1e-9 * pair.scale()) continue;
      const CoreOverlap grown = epa_overlap(pair, 1e-11 * pair.scale());
      ++compared;
      CHECK(tried.depth <= grown.depth + 1e-12 * pair.scale());
      CHECK(tried.depth >= grown.depth - grown.error - 1e-12 * pair.scale());
      CHECK(grown.error <= 1e-9 * pair.scale());
    }
    CHECK(compared > 250);
  }
}

TEST_CASE("the GJK distance equals that over all vertices, edges and faces") {
  const std::uint64_t seed = 13;
  CAPTURE(seed);
  Random random(seed);
  int apart = 0, unconverged = 0;
  for (int i = 0; i < 6000; ++i) {
    CAPTURE(i);
    const double size_b = random.one_in(3) ? random.size(1e-3, 1e3) : 1;
    const Core a = any_core(random, 1), b = any_core(random, size_b);
    const CorePair pair{a, b, any_placement(random, 3 * (a.reach + b.reach))};
    const double tolerance = 1e-12 * pair.scale();
    const CoreDistance iterated = gjk_distance(pair, tolerance);
    if (iterated.upper <= tolerance) continue;
    ++apart;
    if (!iterated.converged) {
      ++unconverged;
      continue;
    }
    const CoreDistance full = exhaustive_distance(pair);
    CHECK(std::abs(iterated.upper - full.upper) <= 2 * tolerance);
    CHECK(length(iterated.on_a - iterated.on_b) == doctest::Approx(iterated.upper));
    // The plane perpendicular to the shortest connection separates the two: a proof of the distance.
    const Vector n = normalised(full.on_b - full.on_a);
    CHECK(std::abs(pair.overlap(n) + full.upper) <= 1e-9 * pair.scale());
  }
  CHECK(apart > 2000);
  MESSAGE(unconverged << " of " << apart << " left to the exhaustive form");
  CHECK(unconverged < apart / 20);
}
