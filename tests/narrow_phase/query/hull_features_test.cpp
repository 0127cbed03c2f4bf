// Searches through the features of a hull against one feature after another, and the distances that they prove.
#include "narrow_phase/query/hull_features.hpp"

#include <cmath>
#include <cstdint>
#include <limits>
#include <vector>

#include <doctest/doctest.h>

#include "geometry/every_target.hpp"
#include "geometry/vector.hpp"
#include "narrow_phase/query/hull_point_distance.hpp"
#include "narrow_phase/query/query_world.hpp"

namespace ringfence::narrow_phase_test {
namespace {

using narrow_phase::ConvexCore;
using narrow_phase::CoreDistance;
using narrow_phase::Placement;

constexpr double infinity = std::numeric_limits<double>::infinity();

std::uint32_t farthest_in_order(const geometry::Hull& hull, const Vec3d& direction) {
  std::uint32_t best = 0;
  for (std::uint32_t i = 1; i < hull.vertex_count(); ++i) {
    if (dot(direction, to_double(hull.vertex(i))) > dot(direction, to_double(hull.vertex(best)))) best = i;
  }
  return best;
}

double farthest_plane_in_order(const geometry::Hull& hull, const Vec3d& point) {
  double most = -infinity;
  for (std::size_t i = 0; i < hull.face_count(); ++i) {
    most = std::max(most, dot(to_double(hull.normal(i)), point) - double{hull.offset()[i]});
  }
  return most;
}

double distance_to_edge(const geometry::Hull& hull, std::uint32_t edge, const Vec3d& point) {
  const Vec3d from = to_double(hull.vertex(hull.edges()[edge].from)),
              to = to_double(hull.vertex(hull.edges()[edge].to));
  const Vec3d along = to - from;
  const double part = std::clamp(dot(point - from, along) / dot(along, along), 0.0, 1.0);
  return length(point - from - along * part);
}

/// A point around a hull, on its axes.
struct Place {
  const geometry::Hull* hull;
  ShapeNumber shape;
  Vec3d point;
};

/// Calls `check(place)` for points around random hulls, or around hulls of extreme forms.
template <class Check>
void for_places(const QueryWorld& world, const Check& check) {
  const geometry::ShapeView shapes = world.pairs.shapes().view();
  for (const QueryCase& query : world.cases) {
    const narrow_phase::Body& body = world.target(query);
    const Vec3d point =
        geometry::rotate_inverse(geometry::rotation_exact(body.pose.orientation), query.start - body.pose.position);
    check(Place{&shapes.hull(shapes.row(body.shape).index_in_kind), body.shape, point});
  }
}

TEST_CASE("features found at once are those found one after another, on every target") {
  for (const bool hard : {false, true}) {
    CAPTURE(hard);
    const QueryWorld world = make_queries(ShapeKind::hull, ShapeKind::sphere, hard, 400, hard ? 80 : 79);
    std::vector<std::uint32_t> faces, edges;  // of the first target
    test::on_every_target([&] {
      std::size_t next = 0;
      for_places(world, [&](const Place& place) {
        const geometry::Hull& hull = *place.hull;
        const double size = double{hull.bounding_radius()}, reach = size + length(place.point);
        CHECK(narrow_phase::farthest_vertex(hull, place.point) == farthest_in_order(hull, place.point));
        const double farthest = farthest_plane_in_order(hull, place.point);
        CHECK(narrow_phase::farthest_plane(hull, place.point) == farthest);

        const narrow_phase::HighestFace highest = narrow_phase::highest_face(hull, to_float(place.point));
        REQUIRE(highest.face < hull.face_count());
        CHECK(std::abs(double{highest.height} - farthest) <= 0x1p-20 * reach);

        const std::uint32_t edge = narrow_phase::nearest_edge(hull, to_float(place.point));
        REQUIRE(edge < hull.edge_count());
        double least = infinity;
        for (std::uint32_t i = 0; i < hull.edge_count(); ++i) {
          least = std::min(least, distance_to_edge(hull, i, place.point));
        }
        const double found = distance_to_edge(hull, edge, place.point);
        CHECK(found * found - least * least <= 0x1p-18 * reach * reach);

        if (next == faces.size()) faces.push_back(highest.face), edges.push_back(edge);
        CHECK(faces[next] == highest.face);
        CHECK(edges[next] == edge);
        ++next;
      });
    });
  }
}

TEST_CASE("most distances of a point from a hull are proven by a feature, and they are those of the complete search") {
  for (const bool hard : {false, true}) {
    CAPTURE(hard);
    const QueryWorld world = make_queries(ShapeKind::hull, ShapeKind::sphere, hard, 3000, hard ? 82 : 81);
    const geometry::ShapeView shapes = world.pairs.shapes().view();
    std::size_t outside = 0, proven = 0;
    for_places(world, [&](const Place& place) {
      const Placement placement{{{{0, 1, 0}, {0, 0, 1}, {1, 0, 0}}}, {3, -5, 7}};
      const ConvexCore hull(shapes, place.shape, placement);
      Placement of_point;
      of_point.position = placement(place.point);
      // core_distance() does not take a triangle whose corners are one point for a point, so it searches.
      const Vec3d corners[3] = {of_point.position, of_point.position, of_point.position};
      const CoreDistance searched = core_distance(hull, ConvexCore::triangle(corners), infinity);
      CoreDistance found;
      const double size = double{place.hull->bounding_radius()};
      if (farthest_plane_in_order(*place.hull, place.point) > 1e-3 * size) ++outside;
      if (!hull_point_distance(hull, of_point.position, 0, infinity, found)) return;
      ++proven;
      const double tolerance = 0x1p-42 * (size + length(of_point.position));
      CHECK(found.kind == CoreDistance::Kind::apart);
      CHECK(std::abs(found.upper - searched.upper) <= tolerance);
      CHECK(found.lower <= found.upper);
      CHECK(found.upper - found.lower <= tolerance);
      CHECK(length(found.on_b - found.on_a) == doctest::Approx(found.upper));
      CHECK(length(found.on_a + found.normal * found.upper - found.on_b) <= tolerance);
      CHECK(std::abs(length(found.on_a - searched.on_a)) <= 1e-5 * size);

      CoreDistance limited;
      REQUIRE(hull_point_distance(hull, of_point.position, 0, 0.999 * found.upper, limited));
      CHECK(limited.kind == CoreDistance::Kind::beyond);
      REQUIRE(hull_point_distance(hull, of_point.position, 1.001 * found.upper, 0, limited));
      CHECK(limited.kind == CoreDistance::Kind::touch);
    });
    CHECK(outside > 1000);
    CHECK(proven > (hard ? outside / 2 : outside / 100 * 98));
  }
}

}  // namespace
}  // namespace ringfence::narrow_phase_test
