// Rays against one shape: exact cases, and the reference.
#include <cmath>
#include <cstdint>
#include <string>
#include <variant>

#include <doctest/doctest.h>

#include "geometry/vector.hpp"
#include "narrow_phase/mesh_world.hpp"
#include "narrow_phase/query/query_world.hpp"
#include "narrow_phase/query/shape_query.hpp"

namespace ringfence::narrow_phase_test {
namespace {

using narrow_phase::Ray;
using narrow_phase::ShapeHit;

constexpr ShapeKind all_kinds[] = {ShapeKind::sphere, ShapeKind::box,  ShapeKind::capsule,
                                   ShapeKind::hull,   ShapeKind::mesh, ShapeKind::support};
constexpr Vec3d far_away{1e6, -1e6, 1e6};

/// One shape at a pose.
class Target {
 public:
  explicit Target(const ShapeDescription& shape, const Pose& pose = {}) : pose_(pose) { table_.add(shape); }

  bool cast(const Vec3d& start, const Vec3d& displacement, ShapeHit& hit, double limit = 1) const {
    return cast_ray(table_.view(), 0, pose_, Ray::along(start, displacement), limit, hit);
  }

 private:
  geometry::ShapeTable table_;
  Pose pose_;
};

ConvexHull cube(float half) {
  ConvexHull out;
  for (int i = 0; i < 8; ++i) out.points.push_back({i & 1 ? half : -half, i & 2 ? half : -half, i & 4 ? half : -half});
  return out;
}

double accuracy_of(ShapeKind kind) {
  // The normals of the faces of hulls and meshes are floats.
  return kind == ShapeKind::support ? 1e-4 : kind == ShapeKind::hull ? 2e-6 : kind == ShapeKind::mesh ? 3e-7 : 1e-10;
}

TEST_CASE("random rays have the hits of the reference") {
  std::uint64_t seed = 1100;
  for (const ShapeKind kind : all_kinds) {
    for (const Vec3d& origin : {Vec3d{}, far_away}) {
      CAPTURE(std::string(name_of(kind)));
      ++seed;
      CAPTURE(seed);
      const QueryTally tally =
          check_rays(make_queries(kind, ShapeKind::sphere, false, 1000 * query_scale, seed, origin), accuracy_of(kind));
      INFO(tally.text);
      CHECK(tally.wrong == 0);
      CHECK(tally.hits > 100 * query_scale);
      CHECK(tally.misses > 200 * query_scale);
    }
  }
}

TEST_CASE("hard rays have the hits of the reference") {
  std::uint64_t seed = 1200;
  for (const ShapeKind kind : all_kinds) {
    for (const Vec3d& origin : {Vec3d{}, far_away}) {
      CAPTURE(std::string(name_of(kind)));
      ++seed;
      CAPTURE(seed);
      const QueryTally tally =
          check_rays(make_queries(kind, ShapeKind::sphere, true, 2000 * query_scale, seed, origin), accuracy_of(kind));
      INFO(tally.text);
      CHECK(tally.wrong == 0);
      CHECK(tally.hits > 100 * query_scale);
    }
  }
}

TEST_CASE("a ray at the middle of a face enters there") {
  const ShapeDescription shapes[] = {Sphere{1}, Box{{1, 1, 1}}, Capsule{1, 2}, cube(1), box_surface({1, 1, 1}, 1)};
  for (const ShapeDescription& shape : shapes) {
    CAPTURE(shape.index());
    ShapeHit hit;
    REQUIRE(Target(shape).cast({4, 0, 0}, {-8, 0, 0}, hit));
    CHECK(hit.fraction == 0.375);
    CHECK(hit.normal == Vec3d{1, 0, 0});
    CHECK(hit.point == Vec3d{1, 0, 0});
    CHECK_FALSE(Target(shape).cast({4, 0, 0}, {-2, 0, 0}, hit));
    CHECK_FALSE(Target(shape).cast({4, 0, 0}, {8, 0, 0}, hit));
    CHECK_FALSE(Target(shape).cast({4, 1.5, 0}, {-8, 0, 0}, hit));
  }
}

TEST_CASE("a ray that ends on the surface hits it at fraction 1") {
  const ShapeDescription shapes[] = {Sphere{1}, Box{{1, 1, 1}}, Capsule{1, 2}, cube(1), box_surface({1, 1, 1}, 1)};
  for (const ShapeDescription& shape : shapes) {
    CAPTURE(shape.index());
    ShapeHit hit;
    REQUIRE(Target(shape).cast({4, 0, 0}, {-3, 0, 0}, hit));
    CHECK(hit.fraction == 1);
    CHECK_FALSE(Target(shape).cast({4, 0, 0}, {-2.999999, 0, 0}, hit));
  }
}

TEST_CASE("a ray that starts inside a solid hits it at its start, with the normal against its direction") {
  const ShapeDescription shapes[] = {Sphere{1}, Box{{1, 1, 1}}, Capsule{1, 2}, cube(1)};
  for (const ShapeDescription& shape : shapes) {
    CAPTURE(shape.index());
    ShapeHit hit;
    for (const Vec3d& start : {Vec3d{0, 0.25, 0}, Vec3d{0, 1, 0}}) {
      REQUIRE(Target(shape).cast(start, {0, 5, 0}, hit));
      CHECK(hit.fraction == 0);
      CHECK(hit.normal == Vec3d{0, -1, 0});
      CHECK(hit.point == start);
    }
  }
}

/// A point of a shape's surface, but for rounding, and the outward unit normal there.
struct SurfacePoint {
  Vec3d point, normal;
};

SurfacePoint on_surface(const ShapeDescription& shape, RandomSource& random) {
  const Vec3d n = random.direction();
  if (const auto* ball = std::get_if<Sphere>(&shape)) return {n * double{ball->radius}, n};
  if (const auto* capsule = std::get_if<Capsule>(&shape)) {
    return {n * double{capsule->radius} + Vec3d{0, 0, std::copysign(double{capsule->half_height}, n.z)}, n};
  }
  return {{1, n.y, n.z}, {1, 0, 0}};  // a box or a hull: the cube of half extent 1
}

TEST_CASE("a ray that starts on the surface of a convex shape, as rounded, and goes inwards hits it at its start") {
  RandomSource random(1302);
  const ShapeDescription shapes[] = {Sphere{0.7f}, Capsule{0.7f, 2}, Box{{1, 1, 1}}, cube(1)};
  for (const ShapeDescription& shape : shapes) {
    CAPTURE(shape.index());
    for (std::size_t i = 0; i < 20'000 * query_scale; ++i) {
      // At the origin the start is closest to the surface, so rounding decides on which side of the start the entry is.
      const Vec3d position = i % 2 == 0 ? Vec3d{} : random.vector(0, 1000);
      const Pose pose{position, i % 4 < 2 ? Quat{} : Quat{0.1f, 0.7f, -0.3f, 0.64f}};
      const SurfacePoint from = on_surface(shape, random);
      const Vec3d side = cross(from.normal, random.direction());
      // The chord inside has a length of about 10^-3 to 1.
      const Vec3d way = side * (1 / length(side)) - from.normal * random.logarithmic(1e-3, 1);
      const geometry::RotationD turn = geometry::rotation_exact(pose.orientation);
      ShapeHit hit;
      const Target target(shape, pose);
      const Vec3d start = position + geometry::rotate(turn, from.point), displacement = geometry::rotate(turn, way) * 4;
      REQUIRE(target.cast(start, displacement, hit));
      CHECK(hit.fraction < 1e-9);
      // Backwards the ray leaves the shape at once: it may hit it there or not, but nowhere else.
      if (target.cast(start, displacement * -1, hit)) CHECK(hit.fraction < 1e-9);
    }
  }
}

TEST_CASE("a ray that starts at the tip of a needle and runs along its inside hits it at its start") {
  // A hull of 33 m by 0.1 m far from the origin. The start is rounded to 10^-10 m, so the line meets several faces at
  // the tip, and the place of the entry is known to 10^-8 m only.
  ConvexHull needle;
  needle.points = {{-16, 0.006f, -0.018f},  {-15.5f, -0.022f, -0.006f}, {-10.8f, -0.039f, 0.01f},
                   {4.1f, 0.014f, 0.048f},  {1, -0.015f, 0.049f},       {12.3f, 0.01f, -0.035f},
                   {9.1f, -0.018f, -0.04f}, {13.8f, 0.02f, 0.023f}};
  needle.points.push_back({16.889377f, -0.003f, -0.01f});
  const Vec3d tip = to_double(needle.points.back()), middle{-2, -0.006, 0.004};
  RandomSource random(1303);
  for (std::size_t i = 0; i < 3000 * query_scale; ++i) {
    const Vec3d position = far_away + random.vector(0, 100);
    const float part = static_cast<float>(i) * 0.001f;
    const Pose pose{position, {part, 0.7f, -0.3f, 0.64f}};
    const geometry::RotationD turn = geometry::rotation_exact(pose.orientation);
    ShapeHit hit;
    REQUIRE(
        Target(needle, pose).cast(position + geometry::rotate(turn, tip), geometry::rotate(turn, middle - tip), hit));
    CHECK(hit.fraction < 1e-7);
  }
}

TEST_CASE("a ray of no length hits what contains its start") {
  const ShapeDescription shapes[] = {Sphere{1}, Box{{1, 1, 1}}, Capsule{1, 2}, cube(1)};
  for (const ShapeDescription& shape : shapes) {
    CAPTURE(shape.index());
    ShapeHit hit;
    REQUIRE(Target(shape).cast({0.5, 0.25, 0}, {}, hit));
    CHECK(hit.fraction == 0);
    CHECK(hit.normal == Vec3d{});
    CHECK(hit.point == Vec3d{0.5, 0.25, 0});
    CHECK_FALSE(Target(shape).cast({1.5, 0.25, 0}, {}, hit));
  }
  const Target surface(box_surface({1, 1, 1}, 1));
  ShapeHit hit;
  CHECK(surface.cast({1, 0.25, 0}, {}, hit));
  CHECK_FALSE(surface.cast({0.5, 0.25, 0}, {}, hit));
}

TEST_CASE("a mesh is hit from inside, with the normal towards the start") {
  ShapeHit hit;
  REQUIRE(Target(box_surface({1, 1, 1}, 1)).cast({0, 0, 0}, {0, 4, 0}, hit));
  CHECK(hit.fraction == 0.25);
  CHECK(hit.normal == Vec3d{0, -1, 0});
}

TEST_CASE("of triangles at the same place the lowest is hit") {
  TriangleMesh mesh;
  mesh.vertices = {{-1, -1, 0}, {1, -1, 0}, {0, 1, 0}, {-1, -1, 1}, {1, -1, 1}, {0, 1, 1}};
  mesh.indices = {0, 1, 2, 3, 4, 5, 3, 5, 4, 0, 2, 1};
  ShapeHit hit;
  REQUIRE(Target(mesh).cast({0, 0, 3}, {0, 0, -6}, hit));
  CHECK(hit.triangle == 1);
  REQUIRE(Target(mesh).cast({0, 0, -3}, {0, 0, 6}, hit));
  CHECK(hit.triangle == 0);
}

TEST_CASE("no ray passes between the triangles of a closed surface") {
  const TriangleMesh mesh = box_surface({1, 1, 1}, 7);
  const Target target(mesh, {{3, 2, 1}, {0.1f, 0.7f, -0.3f, 0.64f}});
  RandomSource random(1301);
  const Vec3d inside{3, 2, 1};
  for (std::size_t i = 0; i < 20'000 * query_scale; ++i) {
    // At a corner, at a point of an edge, or at the middle of an edge.
    const std::size_t t = 3 * static_cast<std::size_t>(random.below(static_cast<int>(mesh.indices.size() / 3)));
    const Vec3d p = to_double(mesh.vertices[mesh.indices[t]]), q = to_double(mesh.vertices[mesh.indices[t + 1]]);
    const double part = random.below(3) == 0 ? 0 : random.below(2) == 0 ? 0.5 : random.uniform(0, 1);
    const geometry::RotationD turn = geometry::rotation_exact({0.1f, 0.7f, -0.3f, 0.64f});
    const Vec3d aim = geometry::rotate(turn, p + (q - p) * part);
    ShapeHit hit;
    CHECK(target.cast(inside, aim * random.uniform(1.5, 100), hit));
  }
}

TEST_CASE("a limit discards hits and changes none") {
  std::uint64_t seed = 1400;
  for (const ShapeKind kind : all_kinds) {
    CAPTURE(std::string(name_of(kind)));
    const QueryWorld world = make_queries(kind, ShapeKind::sphere, true, 500 * query_scale, ++seed);
    for (const QueryCase& query : world.cases) {
      const narrow_phase::Body& body = world.target(query);
      const Ray ray = Ray::along(query.start, query.displacement);
      const auto cast = [&](double limit, ShapeHit& hit) {
        return cast_ray(world.pairs.shapes().view(), body.shape, body.pose, ray, limit, hit);
      };
      ShapeHit hit, again;
      if (!cast(1, hit)) {
        CHECK_FALSE(cast(0.5, again));
        continue;
      }
      REQUIRE(cast(hit.fraction, again));
      CHECK(again.fraction == hit.fraction);
      CHECK(again.normal == hit.normal);
      CHECK(again.point == hit.point);
      CHECK(again.triangle == hit.triangle);
      if (hit.fraction > 0) CHECK_FALSE(cast(std::nextafter(hit.fraction, 0.0), again));
    }
  }
}

TEST_CASE("rays of any finite length have finite hits") {
  const Target target(Box{{1, 1, 1}});
  ShapeHit hit;
  REQUIRE(target.cast({-1e15, 0, 0}, {2e15, 0, 0}, hit));
  CHECK(std::abs(hit.fraction - 0.5) < 1e-14);
  CHECK(target.cast({0, 0, 0}, {1e-300, 0, 0}, hit));
  CHECK(hit.normal == Vec3d{-1, 0, 0});
  CHECK_FALSE(target.cast({2, 0, 0}, {-1e-300, 5e-324, 0}, hit));
}

}  // namespace
}  // namespace ringfence::narrow_phase_test
