// Distances of two shapes against the reference, which shares no code with them.
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include <doctest/doctest.h>

#include "geometry/ellipsoid.hpp"
#include "geometry/vector.hpp"
#include "narrow_phase/convex_world.hpp"
#include "narrow_phase/mesh_world.hpp"
#include "narrow_phase/pair_world.hpp"
#include "narrow_phase/query/shape_pair.hpp"
#include "reference/separation.hpp"

namespace ringfence::narrow_phase_test {
namespace {

using narrow_phase::Body;
using narrow_phase::PairDistance;
using narrow_phase::ShapePair;
using reference::Vector;

/// What ringfence/collide.hpp promises for shapes that are exact.
double error_bound(double sizes, double distance) { return 1e-12 * sizes + 1e-14 * distance; }

/// Counts of the pairs that were checked, so that a test shows what it has covered.
struct Covered {
  int apart = 0, touching = 0;
};

class Checker {
 public:
  explicit Checker(const PairWorld& world) : world_(world) {}

  /// Checks both orders of a pair. Returns the reference's separation of a and b.
  reference::Separation check(const Body& a, const Body& b) {
    const reference::Separation exact = reference::separation(reference_of(a), a.pose, reference_of(b), b.pose);
    const PairDistance found = distance(a, b), swapped = distance(b, a);
    const double sizes = reference_of(a).bounding_radius + reference_of(b).bounding_radius;
    const double true_distance = std::max(0.0, exact.distance);
    const double allowed = error_bound(sizes, true_distance) + exact.error;
    CAPTURE(exact.distance);
    CAPTURE(sizes);
    CHECK(std::abs(found.distance - true_distance) <= allowed);
    CHECK(std::abs(swapped.distance - true_distance) <= allowed);
    check_points(a, b, found, allowed);
    check_points(b, a, swapped, allowed);
    ++(found.distance > 0 ? covered.apart : covered.touching);
    return exact;
  }

  Covered covered;

 private:
  const reference::PreparedShape& reference_of(const Body& body) const { return world_.reference[body.shape]; }

  PairDistance distance(const Body& a, const Body& b) const {
    return ShapePair(world_.shapes().view(), a.shape, world_.shapes().view(), b.shape).distance(a.pose, b.pose);
  }

  /// The distance of a point, relative to a's position, from a shape; 0 inside.
  double outside(const Vec3d& point, const Body& a, const Body& body) const {
    static const reference::Shapes points = [] {
      const ShapeDescription point_shape = Sphere{0};
      return reference::Shapes({&point_shape, 1});
    }();
    // Relative to a: the sum with its position would be rounded.
    const Pose at_point{point, {}}, relative{body.pose.position - a.pose.position, body.pose.orientation};
    return reference::separation(reference_of(body), relative, points[0], at_point).distance;
  }

  void check_points(const Body& a, const Body& b, const PairDistance& found, double allowed) const {
    const double from_a = outside(found.on_a, a, a), from_b = outside(found.on_b, a, b);
    CHECK(from_a <= allowed);
    CHECK(from_b <= allowed);
    if (found.distance == 0) {
      CHECK(found.on_a == found.on_b);
      CHECK(found.normal == Vec3d{});
      return;
    }
    CHECK(std::abs(length(found.normal) - 1) <= 1e-14);
    const Vec3d expected = found.normal * found.distance;
    CHECK(length((found.on_b - found.on_a) - expected) <= 2 * allowed + 1e-7 * found.distance);
    CHECK(std::abs(length(found.on_b - found.on_a) - found.distance) <= 2 * allowed);
  }

  const PairWorld& world_;
};

/// Checks all pairs of a world, and each of them again with b moved along the reference's normal to a gap of given
/// parts of the smaller size.
Covered check_world(const PairWorld& world, bool with_gaps) {
  Checker checker(world);
  for (std::size_t i = 0; i < world.pairs.size(); ++i) {
    CAPTURE(i);
    const Body &a = world.bodies[world.pairs[i].a], &b = world.bodies[world.pairs[i].b];
    const reference::Separation exact = checker.check(a, b);
    if (!with_gaps) continue;
    const double small = std::min(world.reference[a.shape].bounding_radius, world.reference[b.shape].bounding_radius);
    for (const double gap : {0.0, 1e-15, 1e-12, 1e-9, 1e-6, 1e-4, 1e-2, 1.0, 1e3}) {
      CAPTURE(gap);
      Body moved = b;
      moved.pose.position = b.pose.position + Vec3d(Vector(exact.normal) * (gap * small - exact.distance));
      checker.check(a, moved);
    }
  }
  return checker.covered;
}

constexpr ShapeKind primitive_kinds[] = {ShapeKind::sphere, ShapeKind::box, ShapeKind::capsule};
constexpr ShapeKind convex_kinds[] = {ShapeKind::sphere, ShapeKind::box, ShapeKind::capsule, ShapeKind::hull};

TEST_CASE("distances of random convex shapes are those of the reference within the stated error") {
  std::uint64_t seed = 100;
  for (const ShapeKind p : convex_kinds) {
    for (const ShapeKind q : convex_kinds) {
      if (q < p) continue;
      CAPTURE(name_of(p));
      CAPTURE(name_of(q));
      ++seed;
      CAPTURE(seed);
      const Covered covered = check_world(ordinary_convex_pairs(p, q, 300, seed), true);
      CHECK(covered.apart > 1000);
      CHECK(covered.touching > 100);
    }
  }
}

TEST_CASE("distances of hard pairs of primitives are those of the reference within the stated error") {
  std::uint64_t seed = 200;
  for (const ShapeKind p : primitive_kinds) {
    for (const ShapeKind q : primitive_kinds) {
      if (q < p) continue;
      CAPTURE(name_of(p));
      CAPTURE(name_of(q));
      ++seed;
      CAPTURE(seed);
      check_world(degenerate_pairs(p, q, 1000, seed), true);
    }
  }
}

TEST_CASE("distances of hard pairs with hulls are those of the reference within the stated error") {
  std::uint64_t seed = 300;
  for (const ShapeKind p : convex_kinds) {
    CAPTURE(name_of(p));
    ++seed;
    CAPTURE(seed);
    check_world(degenerate_convex_pairs(p, ShapeKind::hull, 300, seed), true);
  }
}

TEST_CASE("distances from meshes are those of the reference within the stated error") {
  std::uint64_t seed = 400;
  for (const ShapeKind p : {ShapeKind::sphere, ShapeKind::box, ShapeKind::capsule, ShapeKind::hull, ShapeKind::mesh}) {
    CAPTURE(name_of(p));
    ++seed;
    CAPTURE(seed);
    check_world(ordinary_mesh_pairs(p, 40, seed, {}, 100), false);
    check_world(degenerate_mesh_pairs(p, 40, seed, {}, 100), true);
  }
}

TEST_CASE("distances are as precise a million metres from the origin, and over a million metres") {
  const Vec3d far{1e6, -1e6, 1e6};
  std::uint64_t seed = 500;
  for (const ShapeKind p : convex_kinds) {
    CAPTURE(name_of(p));
    ++seed;
    CAPTURE(seed);
    check_world(ordinary_convex_pairs(p, ShapeKind::hull, 100, seed, far), true);
    PairWorld world = ordinary_convex_pairs(p, ShapeKind::hull, 100, seed);
    RandomSource random(seed);
    for (Body& body : world.bodies) body.pose.position = random.vector(0, 1e6);
    check_world(world, false);
  }
}

/// A hull of the corners of a box: a box for the kernels of hulls.
ConvexHull box_hull(const Vec3f& h) {
  ConvexHull hull;
  for (int i = 0; i < 8; ++i) hull.points.push_back({i & 1 ? h.x : -h.x, i & 2 ? h.y : -h.y, i & 4 ? h.z : -h.z});
  return hull;
}

TEST_CASE("parallel faces, edges and corners of boxes and hulls of 1 mm to 1000 km have exact distances") {
  const std::uint64_t seed = 600;
  CAPTURE(seed);
  RandomSource random(seed);
  for (int i = 0; i < 3000; ++i) {
    CAPTURE(i);
    const double sizes[] = {random.logarithmic(1e-3, 1e6), random.logarithmic(1e-3, 1e6)};
    PairWorld world;
    std::uint32_t bodies[2];
    Vec3f halves[2];
    Quat orientation = random.below(2) == 0 ? Quat{} : random.orientation();
    for (int k = 0; k < 2; ++k) {
      const auto side = [&] {
        const double thin = random.below(3) == 0 ? 1e-3 : 1.0;
        return static_cast<float>(std::max(5e-4, 0.5 * sizes[k] * thin));
      };
      halves[k].x = side(), halves[k].y = side(), halves[k].z = side();
      const ShapeDescription shape =
          random.below(2) == 0 ? ShapeDescription(Box{halves[k]}) : ShapeDescription(box_hull(halves[k]));
      if (k == 1) orientation = random.special_orientation(orientation);
      bodies[k] = world.add(shape, {{}, orientation});
    }
    const double reach = world.reference[0].bounding_radius + world.reference[1].bounding_radius;
    world.bodies[bodies[1]].pose.position = random.vector(0, random.below(3) == 0 ? 3 * reach : reach);
    world.pairs = {{bodies[0], bodies[1]}};
    check_world(world, true);
  }
}

TEST_CASE("distances of ellipsoids that are given by a support function are those of the reference") {
  const std::uint64_t seed = 700;
  CAPTURE(seed);
  RandomSource random(seed);
  for (int i = 0; i < 400; ++i) {
    CAPTURE(i);
    PairWorld world;
    const auto radius = [&] { return static_cast<float>(random.uniform(0.2, 1.5)); };
    const auto ellipsoid = [&] {
      const float x = radius(), y = radius(), z = radius();
      return SupportShape{std::make_shared<test::Ellipsoid>(Vec3f{x, y, z})};
    };
    const ShapeKind other = static_cast<ShapeKind>(i % 6);
    ShapeDescription second;
    if (other == ShapeKind::support) {
      second = ellipsoid();
    } else if (other == ShapeKind::mesh) {
      second = box_surface({0.5, 0.7, 0.9}, 2);
    } else {
      second = random.ordinary(other);
    }
    const std::uint32_t a = world.add(ellipsoid(), {random.vector(0, 10), random.orientation()});
    const Vec3d there = world.bodies[a].pose.position + random.vector(0, 5);
    const std::uint32_t b = world.add(second, {there, random.orientation()});
    const auto &body_a = world.bodies[a], &body_b = world.bodies[b];
    const reference::Separation exact =
        reference::separation(world.reference[a], body_a.pose, world.reference[b], body_b.pose);
    const double sizes = world.reference[a].bounding_radius + world.reference[b].bounding_radius;
    for (const bool swapped : {false, true}) {
      const auto &first = swapped ? body_b : body_a, &last = swapped ? body_a : body_b;
      const PairDistance found = ShapePair(world.shapes().view(), first.shape, world.shapes().view(), last.shape)
                                     .distance(first.pose, last.pose);
      CHECK(std::abs(found.distance - std::max(0.0, exact.distance)) <= 1e-5 * sizes + exact.error);
      CHECK(std::abs(length(found.on_b - found.on_a) - found.distance) <= 1e-5 * sizes);
    }
  }
}

/// The distance of the cores of two bodies, relative to a's position.
narrow_phase::CoreDistance core_distance_of(const PairWorld& world, const Body& a, const Body& b, double& tolerance) {
  const auto placement = [&](const Body& body) {
    return narrow_phase::Placement{geometry::rotation_exact(body.pose.orientation),
                                   body.pose.position - a.pose.position};
  };
  const geometry::ShapeView shapes = world.shapes().view();
  const narrow_phase::ConvexCore p(shapes, a.shape, placement(a)), q(shapes, b.shape, placement(b));
  const narrow_phase::CoreDistance found = narrow_phase::core_distance(p, q, HUGE_VAL);
  tolerance = 0x1p-45 * (p.reach() + q.reach()) + 0x1p-49 * found.upper;
  return found;
}

TEST_CASE("the proven bounds of a distance are as close together as stated, also at small distances") {
  const std::uint64_t seed = 800;
  CAPTURE(seed);
  const PairWorld worlds[] = {ordinary_convex_pairs(ShapeKind::hull, ShapeKind::hull, 500, seed),
                              degenerate_convex_pairs(ShapeKind::box, ShapeKind::hull, 500, seed + 1),
                              degenerate_convex_pairs(ShapeKind::hull, ShapeKind::hull, 500, seed + 2)};
  for (const PairWorld& world : worlds) {
    for (std::size_t i = 0; i < world.pairs.size(); ++i) {
      CAPTURE(i);
      const Body& a = world.bodies[world.pairs[i].a];
      Body b = world.bodies[world.pairs[i].b];
      double tolerance;
      narrow_phase::CoreDistance found = core_distance_of(world, a, b, tolerance);
      for (const double gap : {1e-3, 1e-6, 1e-9, 1e-12}) {
        if (found.kind != narrow_phase::CoreDistance::Kind::apart) break;
        CAPTURE(gap);
        CHECK(found.upper - found.lower <= tolerance);
        CHECK(found.lower <= found.upper);
        b.pose.position = b.pose.position + found.normal * (gap - found.upper);
        found = core_distance_of(world, a, b, tolerance);
      }
    }
  }
}

}  // namespace
}  // namespace ringfence::narrow_phase_test
