// Pairs with a support function that throws, or returns an impossible point, in some directions.
#include <algorithm>
#include <cstdint>
#include <cstring>
#include <memory>
#include <string>
#include <vector>

#include <doctest/doctest.h>

#include "geometry/ellipsoid.hpp"
#include "geometry/gapped_ellipsoid.hpp"
#include "narrow_phase/convex_world.hpp"
#include "narrow_phase/mesh_world.hpp"
#include "narrow_phase/narrow_phase.hpp"

namespace ringfence::narrow_phase_test {
namespace {

using narrow_phase::NarrowPhase;
using narrow_phase::PairContact;

constexpr std::size_t shapes = 8;
constexpr Vec3f radii(std::size_t i) {
  const auto at = static_cast<float>(i);
  return {0.4f + 0.1f * at, 1.2f - 0.1f * at, 0.5f + 0.05f * at};
}

/// Adds ellipsoids whose support function fails for one direction in `one_in`; for none if that is 0.
std::vector<ShapeNumber> add_ellipsoids(PairWorld& world, std::uint64_t one_in) {
  std::vector<ShapeNumber> numbers;
  for (std::size_t i = 0; i < shapes; ++i) {
    SupportShape shape{std::make_shared<test::Ellipsoid>(radii(i))};
    if (one_in != 0) shape.function = std::make_shared<test::GappedEllipsoid>(radii(i), one_in, 5);
    numbers.push_back(world.table->add(shape));
  }
  return numbers;
}

/// Contacts indexed by pair; pairs without contact have the depth -1.
std::vector<PairContact> by_pair(std::span<const PairContact> found, std::size_t pairs) {
  std::vector<PairContact> out(pairs, PairContact{0, -1, {}, {}});
  for (const PairContact& contact : found) out[contact.pair] = contact;
  return out;
}

/// Tests the world with intact and with failing ellipsoids in place of shape b and, if `both`, of shape a.
void check(PairWorld world, bool both) {
  const auto place = [&](const std::vector<ShapeNumber>& numbers, bool first) {
    for (const geometry::CandidatePair& pair : world.pairs) {
      world.bodies[first ? pair.a : pair.b].shape = numbers[pair.b % shapes];
    }
  };
  std::vector<std::vector<ShapeNumber>> added;
  const std::uint64_t gaps[] = {0, 2000, 300, 30, 3, 1};
  for (const std::uint64_t one_in : gaps) added.push_back(add_ellipsoids(world, one_in));
  std::vector<PairContact> whole;
  for (std::size_t i = 0; i < std::size(gaps); ++i) {
    CAPTURE(gaps[i]);
    place(added[i], false);
    if (both) place(added[i], true);
    NarrowPhase narrow_phase(world.shapes());
    const auto found = by_pair(narrow_phase.test(world.bodies, world.pairs), world.pairs.size());
    std::uint64_t failed = 0;
    for (const ShapeKind p : {ShapeKind::sphere, ShapeKind::box, ShapeKind::capsule, ShapeKind::hull, ShapeKind::mesh,
                              ShapeKind::support}) {
      failed += narrow_phase.counters(p, ShapeKind::support).failed;
    }
    if (i == 0) {
      CHECK(failed == 0);
      whole = found;
      continue;
    }
    // Pairs that do not fail have the same contacts as with intact ellipsoids, and failures are counted.
    std::uint64_t lost = 0;
    for (std::size_t pair = 0; pair < whole.size(); ++pair) {
      if (found[pair].depth < 0) {
        lost += whole[pair].depth >= 0 ? 1 : 0;
      } else {
        REQUIRE(std::memcmp(&found[pair], &whole[pair], sizeof(PairContact)) == 0);
      }
    }
    CHECK(lost <= failed);
    const auto touching = std::count_if(whole.begin(), whole.end(), [](const PairContact& c) { return c.depth >= 0; });
    if (gaps[i] <= 300) CHECK(lost > 0);
    if (gaps[i] <= 3) CHECK(lost == static_cast<std::uint64_t>(touching));
  }
}

}  // namespace

TEST_CASE(
    "a failing support function loses only the pairs that need the failing directions, against every convex kind") {
  for (const ShapeKind kind : {ShapeKind::sphere, ShapeKind::box, ShapeKind::capsule, ShapeKind::hull}) {
    CAPTURE(std::string(name_of(kind)));
    check(ordinary_convex_pairs(kind, ShapeKind::hull, 300, 8), false);
  }
}

TEST_CASE("two failing support functions lose only the pairs that need the failing directions") {
  check(ordinary_convex_pairs(ShapeKind::sphere, ShapeKind::hull, 300, 9), true);
}

TEST_CASE("a failing support function loses only the pairs that need the failing directions, against meshes") {
  PairWorld world = ordinary_mesh_pairs(ShapeKind::sphere, 40, 39);
  world.pairs = world.swapped();  // so that the ellipsoid, which replaces the sphere, is b
  check(std::move(world), false);
}

TEST_CASE("bounds of a failing support shape are those of its bounding ball and contain those of the intact shape") {
  const geometry::FixedSpace space({-10, -10, -10}, {10, 10, 10});
  geometry::ShapeTable table;
  const ShapeNumber whole = table.add(SupportShape{std::make_shared<test::Ellipsoid>(radii(2))});
  const ShapeNumber gaps = table.add(SupportShape{std::make_shared<test::GappedEllipsoid>(radii(2), 1)});
  const Pose turned{{1, 2, 3}, {0.6f, 0, 0, 0.8f}};
  const geometry::Bounds inner = table.bounds(whole, turned, space), outer = table.bounds(gaps, turned, space);
  const ShapeNumber ball = table.add(Sphere{table.row(gaps).bounding_radius});
  CHECK(outer == table.bounds(ball, turned, space));
  for (int axis = 0; axis < 3; ++axis) {
    CHECK(outer.lower[axis] <= inner.lower[axis]);
    CHECK(outer.upper[axis] >= inner.upper[axis]);
  }
  const std::vector<std::string> failures = table.take_support_failures();
  REQUIRE(failures.size() == 1);
  CHECK(failures[0].find("shape 1: support(): no point in this direction") == 0);
  CHECK(table.take_support_failures().empty());
}

}  // namespace ringfence::narrow_phase_test
