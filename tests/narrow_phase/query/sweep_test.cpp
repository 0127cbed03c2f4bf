// Sweeps and overlaps of convex shapes against one shape: exact cases, properties, and the reference.
#include <cmath>
#include <cstdint>
#include <string>

#include <doctest/doctest.h>

#include "geometry/vector.hpp"
#include "narrow_phase/mesh_world.hpp"
#include "narrow_phase/query/query_world.hpp"
#include "narrow_phase/query/shape_query.hpp"

namespace ringfence::narrow_phase_test {
namespace {

using narrow_phase::QueryShape;
using narrow_phase::Ray;
using narrow_phase::ShapeHit;

constexpr ShapeKind all_kinds[] = {ShapeKind::sphere, ShapeKind::box,  ShapeKind::capsule,
                                   ShapeKind::hull,   ShapeKind::mesh, ShapeKind::support};
constexpr ShapeKind convex_kinds[] = {ShapeKind::sphere, ShapeKind::box, ShapeKind::capsule, ShapeKind::hull,
                                      ShapeKind::support};
constexpr Vec3d far_away{1e6, -1e6, 1e6};

double accuracy_of(ShapeKind p, ShapeKind q) {
  return p == ShapeKind::support || q == ShapeKind::support ? 1e-4 : 1e-7;
}

/// A shape at the world's origin and another one.
class Pair {
 public:
  Pair(const ShapeDescription& target, const ShapeDescription& moving) { table_.add(target), table_.add(moving); }

  bool sweep(const Vec3d& start, const Vec3d& displacement, ShapeHit& hit) const {
    return sweep_shape(table_.view(), 0, {}, {table_.view(), 1, {}}, Ray::along(start, displacement), 1, hit);
  }
  bool overlap(const Vec3d& position, std::uint32_t& triangle) const {
    return narrow_phase::overlaps(table_.view(), 0, {}, {table_.view(), 1, {}}, position, triangle);
  }

 private:
  geometry::ShapeTable table_;
};

void check_all_pairs(bool hard, std::size_t count, std::uint64_t seed) {
  for (const ShapeKind target : all_kinds) {
    for (const ShapeKind moving : convex_kinds) {
      for (const Vec3d& origin : {Vec3d{}, far_away}) {
        CAPTURE(std::string(name_of(target)));
        CAPTURE(std::string(name_of(moving)));
        ++seed;
        CAPTURE(seed);
        const QueryTally tally =
            check_sweeps(make_queries(target, moving, hard, count, seed, origin), accuracy_of(target, moving));
        INFO(tally.text);
        CHECK(tally.wrong == 0);
        CHECK(tally.hits + tally.inside > count / 20);
      }
    }
  }
}

TEST_CASE("random sweeps have the contacts of the reference") { check_all_pairs(false, 60 * query_scale, 3100); }

TEST_CASE("hard sweeps have the contacts of the reference") { check_all_pairs(true, 120 * query_scale, 3200); }

TEST_CASE("overlaps are those of the reference") {
  std::uint64_t seed = 3300;
  for (const ShapeKind target : all_kinds) {
    for (const ShapeKind moving : convex_kinds) {
      for (const bool hard : {false, true}) {
        CAPTURE(std::string(name_of(target)));
        CAPTURE(std::string(name_of(moving)));
        CAPTURE(hard);
        ++seed;
        CAPTURE(seed);
        // The kernels of contacts decide, which compute in float; for meshes the functions of sweeps.
        const bool in_double = target == ShapeKind::mesh;
        const double accuracy = accuracy_of(target, moving) == 1e-4 ? 1e-4 : in_double ? 1e-10 : 1e-5;
        const QueryTally tally =
            check_overlaps(make_queries(target, moving, hard, 500 * query_scale, seed, far_away), accuracy);
        INFO(tally.text);
        CHECK(tally.wrong == 0);
        CHECK(tally.inside > 20 * query_scale);
        CHECK(tally.misses > 20 * query_scale);
      }
    }
  }
}

TEST_CASE("a shape that moves straight onto a face touches it at the expected place") {
  const ShapeDescription targets[] = {Sphere{1}, Box{{1, 1, 1}}, Capsule{1, 2}, box_surface({1, 1, 1}, 1)};
  const ShapeDescription moving[] = {Sphere{0.5f}, Box{{0.5f, 0.5f, 0.5f}}, Capsule{0.5f, 1}};
  for (const ShapeDescription& target : targets) {
    for (const ShapeDescription& shape : moving) {
      CAPTURE(target.index());
      CAPTURE(shape.index());
      const Pair pair(target, shape);
      ShapeHit hit;
      REQUIRE(pair.sweep({3.5, 0, 0}, {-8, 0, 0}, hit));
      CHECK(std::abs(hit.fraction - 0.25) < 1e-12);
      CHECK(length(hit.normal - Vec3d{1, 0, 0}) < 1e-7);
      CHECK(std::abs(hit.point.x - 1) < 1e-9);
      CHECK_FALSE(pair.sweep({3.5, 0, 0}, {-1.999, 0, 0}, hit));
      CHECK_FALSE(pair.sweep({3.5, 0, 0}, {4, 0, 0}, hit));
      CHECK_FALSE(pair.sweep({3.5, 1.6, 0}, {-8, 0, 0}, hit));
    }
  }
}

TEST_CASE("a sweep that starts in contact hits at its start, with the normal against its direction") {
  const ShapeDescription targets[] = {Sphere{1}, Box{{1, 1, 1}}, Capsule{1, 2}, box_surface({1, 1, 1}, 1)};
  for (const ShapeDescription& target : targets) {
    CAPTURE(target.index());
    const Pair pair(target, Sphere{0.5f});
    ShapeHit hit;
    REQUIRE(pair.sweep({1.25, 0, 0}, {3, 0, 0}, hit));
    CHECK(hit.fraction == 0);
    CHECK(hit.normal == Vec3d{-1, 0, 0});
    CHECK(hit.point == Vec3d{1.25, 0, 0});
    REQUIRE(pair.sweep({1.25, 0, 0}, {}, hit));
    CHECK(hit.normal == Vec3d{});
    CHECK_FALSE(pair.sweep({1.75, 0, 0}, {}, hit));
    CHECK_FALSE(pair.sweep({1.75, 0, 0}, {3, 0, 0}, hit));
  }
}

TEST_CASE("touching shapes overlap, and the lowest triangle is named") {
  std::uint32_t triangle = 7;
  CHECK(Pair(Box{{1, 1, 1}}, Box{{0.5f, 0.5f, 0.5f}}).overlap({1.5, 0, 0}, triangle));
  CHECK(triangle == 0);
  CHECK_FALSE(Pair(Box{{1, 1, 1}}, Box{{0.5f, 0.5f, 0.5f}}).overlap({1.500001, 0, 0}, triangle));
  CHECK(Pair(Sphere{1}, Sphere{0.5f}).overlap({0, 1.5, 0}, triangle));
  TriangleMesh mesh;
  mesh.vertices = {{-1, -1, 5}, {1, -1, 5}, {0, 1, 5}, {-1, -1, 0}, {1, -1, 0}, {0, 1, 0}};
  mesh.indices = {0, 1, 2, 3, 4, 5, 3, 5, 4};
  CHECK(Pair(mesh, Sphere{1}).overlap({0, 0, 1}, triangle));
  CHECK(triangle == 1);
  CHECK(Pair(mesh, Box{{1, 1, 1}}).overlap({0, 0, -1}, triangle));
  CHECK(triangle == 1);
  CHECK_FALSE(Pair(mesh, Sphere{1}).overlap({0, 0, 2.5}, triangle));
}

TEST_CASE("the sweep of a small ball is a ray but for its radius") {
  std::uint64_t seed = 3400;
  geometry::ShapeTable balls;
  balls.add(Sphere{0.0005f});
  for (const ShapeKind kind : all_kinds) {
    CAPTURE(std::string(name_of(kind)));
    const QueryWorld world = make_queries(kind, ShapeKind::sphere, false, 300 * query_scale, ++seed);
    for (const QueryCase& query : world.cases) {
      const narrow_phase::Body& body = world.target(query);
      const Ray ray = Ray::along(query.start, query.displacement);
      ShapeHit of_ray, of_ball;
      if (!cast_ray(world.pairs.shapes().view(), body.shape, body.pose, ray, 1, of_ray)) continue;
      // A ball touches whatever its centre touches, and no later.
      REQUIRE(sweep_shape(world.pairs.shapes().view(), body.shape, body.pose, {balls.view(), 0, {}}, ray, 1, of_ball));
      const double rounding = kind == ShapeKind::support ? 1e-4 : 1e-5;
      CHECK(of_ball.fraction * ray.length <= of_ray.fraction * ray.length + rounding);
    }
  }
}

TEST_CASE("a sweep and the sweep of the other shape the other way have the same fraction") {
  std::uint64_t seed = 3500;
  for (const ShapeKind p : convex_kinds) {
    for (const ShapeKind q : convex_kinds) {
      CAPTURE(std::string(name_of(p)));
      CAPTURE(std::string(name_of(q)));
      const QueryWorld world = make_queries(p, q, false, 50 * query_scale, ++seed);
      const geometry::ShapeView shapes = world.pairs.shapes().view();
      for (const QueryCase& query : world.cases) {
        const narrow_phase::Body &a = world.target(query), &b = world.moving(query);
        ShapeHit there, back;
        const bool hit = sweep_shape(shapes, a.shape, a.pose, {shapes, b.shape, b.pose.orientation},
                                     Ray::along(query.start, query.displacement), 1, there);
        const bool other =
            sweep_shape(shapes, b.shape, {query.start, b.pose.orientation}, {shapes, a.shape, a.pose.orientation},
                        Ray::along(a.pose.position, -query.displacement), 1, back);
        const double away = length(query.displacement);
        // Where one of them only just touches, only one may.
        if (hit && other && length(there.normal + back.normal) < 1e-3 && dot(there.normal, query.displacement) < -0.1) {
          CHECK(std::abs(there.fraction - back.fraction) * away < (accuracy_of(p, q) == 1e-4 ? 1e-2 : 1e-6));
        }
      }
    }
  }
}

TEST_CASE("a longer sweep touches at the same place") {
  std::uint64_t seed = 3600;
  for (const ShapeKind target : all_kinds) {
    CAPTURE(std::string(name_of(target)));
    const QueryWorld world = make_queries(target, ShapeKind::box, false, 100 * query_scale, ++seed);
    const geometry::ShapeView shapes = world.pairs.shapes().view();
    for (const QueryCase& query : world.cases) {
      const narrow_phase::Body &a = world.target(query), &b = world.moving(query);
      const auto sweep = [&](double factor, ShapeHit& hit) {
        return sweep_shape(shapes, a.shape, a.pose, {shapes, b.shape, b.pose.orientation},
                           Ray::along(query.start, query.displacement * factor), 1, hit);
      };
      ShapeHit hit, longer;
      if (!sweep(1, hit)) continue;
      REQUIRE(sweep(3, longer));
      CHECK(std::abs(longer.fraction * 3 - hit.fraction) * length(query.displacement) < 1e-5);
    }
  }
}

TEST_CASE("a limit discards contacts of sweeps and changes none") {
  std::uint64_t seed = 3700;
  for (const ShapeKind target : all_kinds) {
    for (const ShapeKind moving : {ShapeKind::sphere, ShapeKind::hull}) {
      CAPTURE(std::string(name_of(target)));
      CAPTURE(std::string(name_of(moving)));
      const QueryWorld world = make_queries(target, moving, true, 200 * query_scale, ++seed);
      const geometry::ShapeView shapes = world.pairs.shapes().view();
      for (const QueryCase& query : world.cases) {
        const narrow_phase::Body &a = world.target(query), &b = world.moving(query);
        const auto sweep = [&](double limit, ShapeHit& hit) {
          return sweep_shape(shapes, a.shape, a.pose, {shapes, b.shape, b.pose.orientation},
                             Ray::along(query.start, query.displacement), limit, hit);
        };
        ShapeHit hit, again;
        if (!sweep(1, hit)) continue;
        REQUIRE(sweep(hit.fraction, again));
        CHECK(again.fraction == hit.fraction);
        CHECK(again.normal == hit.normal);
        CHECK(again.point == hit.point);
        CHECK(again.triangle == hit.triangle);
        if (hit.fraction > 0) CHECK_FALSE(sweep(std::nextafter(hit.fraction, 0.0), again));
      }
    }
  }
}

}  // namespace
}  // namespace ringfence::narrow_phase_test
