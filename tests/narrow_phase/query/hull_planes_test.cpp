// A line clipped by the planes of a hull, against one plane after another.
#include "narrow_phase/query/ray/hull_planes.hpp"

#include <limits>

#include <doctest/doctest.h>

#include "geometry/every_target.hpp"
#include "geometry/vector.hpp"
#include "narrow_phase/query/query_world.hpp"

namespace ringfence::narrow_phase_test {
namespace {

using narrow_phase::LocalRay;
using narrow_phase::PlaneClip;

PlaneClip clip_in_order(const geometry::Hull& hull, const LocalRay& ray, double margin) {
  constexpr double infinity = std::numeric_limits<double>::infinity();
  PlaneClip out{-infinity, infinity, 0, -infinity};
  for (std::uint32_t i = 0; i < hull.face_count(); ++i) {
    const Vec3f n = hull.normal(i);
    const Vec3d normal{double{n.x}, double{n.y}, double{n.z}};
    const double offset = double{hull.offset()[i]}, slope = dot(normal, ray.direction);
    const double at_foot = dot(normal, ray.foot) - (offset + margin);
    out.farthest = std::max(out.farthest, dot(normal, ray.origin) - offset);
    if (slope == 0) {
      if (at_foot > 0) out.leave = -infinity;
      continue;
    }
    const double place = -(at_foot / slope);
    if (slope < 0 && place > out.enter) out.enter = place, out.entered = i;
    if (slope > 0 && place < out.leave) out.leave = place;
  }
  return out;
}

TEST_CASE("clipping by all planes at once has the bits of one plane after another, on every target") {
  for (const bool hard : {false, true}) {
    const QueryWorld world = make_queries(ShapeKind::hull, ShapeKind::sphere, hard, 400, hard ? 78 : 77);
    const geometry::ShapeView shapes = world.pairs.shapes().view();
    test::on_every_target([&] {
      for (const QueryCase& query : world.cases) {
        const narrow_phase::Body& body = world.target(query);
        const geometry::ShapeRow& row = shapes.row(body.shape);
        const geometry::Hull& hull = shapes.hull(row.index_in_kind);
        const narrow_phase::Ray ray = narrow_phase::Ray::along(query.start, query.displacement);
        const LocalRay local(ray, body.pose.position, geometry::rotation_exact(body.pose.orientation),
                             double{row.bounding_radius});
        const PlaneClip expected = clip_in_order(hull, local, 0.001), clip = clip_by_planes(hull, local, 0.001);
        CHECK(clip.enter == expected.enter);
        CHECK(clip.leave == expected.leave);
        CHECK(clip.entered == expected.entered);
        CHECK(clip.farthest == expected.farthest);
      }
    });
  }
}

}  // namespace
}  // namespace ringfence::narrow_phase_test
