// Nearest points of one shape: exact cases, and the reference.
#include <cmath>
#include <cstdint>
#include <limits>
#include <string>

#include <doctest/doctest.h>

#include "narrow_phase/mesh_world.hpp"
#include "narrow_phase/query/query_world.hpp"
#include "narrow_phase/query/shape_query.hpp"

namespace ringfence::narrow_phase_test {
namespace {

using narrow_phase::NearestPoint;

constexpr ShapeKind all_kinds[] = {ShapeKind::sphere, ShapeKind::box,  ShapeKind::capsule,
                                   ShapeKind::hull,   ShapeKind::mesh, ShapeKind::support};
constexpr double no_limit = std::numeric_limits<double>::infinity();

double accuracy_of(ShapeKind kind) { return kind == ShapeKind::support ? 1e-4 : 1e-10; }

bool nearest_of(const ShapeDescription& shape, const Vec3d& point, double limit, NearestPoint& out) {
  geometry::ShapeTable table;
  table.add(shape);
  return find_nearest(table.view(), 0, {}, point, limit, out);
}

TEST_CASE("nearest points are those of the reference") {
  std::uint64_t seed = 2100;
  for (const ShapeKind kind : all_kinds) {
    for (const bool hard : {false, true}) {
      for (const Vec3d& origin : {Vec3d{}, Vec3d{1e6, -1e6, 1e6}}) {
        CAPTURE(std::string(name_of(kind)));
        CAPTURE(hard);
        ++seed;
        CAPTURE(seed);
        const QueryTally tally = check_nearest(
            make_queries(kind, ShapeKind::sphere, hard, 1000 * query_scale, seed, origin), accuracy_of(kind));
        INFO(tally.text);
        CHECK(tally.wrong == 0);
        CHECK(tally.hits > 100 * query_scale);
      }
    }
  }
}

TEST_CASE("the nearest point of a box, a ball and a capsule is at the expected place") {
  NearestPoint nearest;
  REQUIRE(nearest_of(Box{{1, 2, 3}}, {4, 0, 7}, no_limit, nearest));
  CHECK(nearest.distance == 5);
  CHECK(nearest.point == Vec3d{1, 0, 3});
  REQUIRE(nearest_of(Sphere{2}, {0, 0, -5}, 3, nearest));
  CHECK(nearest.distance == 3);
  CHECK(nearest.point == Vec3d{0, 0, -2});
  REQUIRE(nearest_of(Capsule{1, 2}, {3, 0, 1}, no_limit, nearest));
  CHECK(nearest.distance == 2);
  CHECK(nearest.point == Vec3d{1, 0, 1});
}

TEST_CASE("a point inside has distance 0, and a mesh has no inside") {
  NearestPoint nearest;
  REQUIRE(nearest_of(Box{{1, 2, 3}}, {0.5, 0, 0}, 0, nearest));
  CHECK(nearest.distance == 0);
  CHECK(nearest.point == Vec3d{0.5, 0, 0});
  REQUIRE(nearest_of(box_surface({1, 2, 3}, 1), {0.5, 0, 0}, no_limit, nearest));
  CHECK(nearest.distance == 0.5);
  CHECK(nearest.point == Vec3d{1, 0, 0});
  CHECK_FALSE(nearest_of(box_surface({1, 2, 3}, 1), {0.5, 0, 0}, 0.25, nearest));
}

TEST_CASE("of triangles at the same distance the lowest is nearest") {
  TriangleMesh mesh;
  mesh.vertices = {{-1, -1, 2}, {1, -1, 2}, {0, 1, 2}, {-1, -1, 1}, {1, -1, 1}, {0, 1, 1}};
  mesh.indices = {0, 1, 2, 3, 4, 5, 3, 5, 4};
  NearestPoint nearest;
  REQUIRE(nearest_of(mesh, {0, 0, 0}, no_limit, nearest));
  CHECK(nearest.triangle == 1);
  CHECK(nearest.distance == 1);
}

TEST_CASE("a limit discards nearest points and changes none") {
  std::uint64_t seed = 2200;
  for (const ShapeKind kind : all_kinds) {
    CAPTURE(std::string(name_of(kind)));
    const QueryWorld world = make_queries(kind, ShapeKind::sphere, true, 300 * query_scale, ++seed);
    for (const QueryCase& query : world.cases) {
      const narrow_phase::Body& body = world.target(query);
      const auto find = [&](double limit, NearestPoint& out) {
        return find_nearest(world.pairs.shapes().view(), body.shape, body.pose, query.start, limit, out);
      };
      NearestPoint nearest, again;
      REQUIRE(find(no_limit, nearest));
      REQUIRE(find(nearest.distance, again));
      CHECK(again.distance == nearest.distance);
      CHECK(again.point == nearest.point);
      CHECK(again.triangle == nearest.triangle);
      if (nearest.distance > 0) CHECK_FALSE(find(std::nextafter(nearest.distance, 0.0), again));
    }
  }
}

}  // namespace
}  // namespace ringfence::narrow_phase_test
