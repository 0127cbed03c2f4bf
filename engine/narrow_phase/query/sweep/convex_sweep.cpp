#include "narrow_phase/query/sweep/convex_sweep.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include "geometry/vector.hpp"
#include "narrow_phase/query/nearest/convex_nearest.hpp"
#include "narrow_phase/query/ray/convex_ray.hpp"
#include "narrow_phase/query/ray/hull_planes.hpp"

namespace ringfence::narrow_phase {
namespace {

/// The first place on the path where a ball around the shape's origin can be touched; more than the end if none is.
double first_place(const LocalRay& path, double reach) noexcept {
  const double rest = reach * reach - dot(path.foot, path.foot);
  if (rest < 0) return path.end + 2 * path.slack;
  return std::max(path.begin, -std::sqrt(rest) - path.slack);
}

SweepContact none() noexcept { return {}; }

SweepContact inside(const LocalRay& path) noexcept {
  SweepContact out;
  out.kind = SweepContact::Kind::inside;
  out.place = path.begin;
  return out;
}

/// A ball against all points within `fixed` of the segment on the z axis.
SweepContact ball_at_rounded_segment(const LocalRay& path, double fixed, double half_height, double radius) noexcept {
  const Vec3d on_axis{0, 0, std::clamp(path.origin.z, -half_height, half_height)}, away = path.origin - on_axis;
  const double both = fixed + radius;
  if (dot(away, away) <= both * both) return inside(path);
  LocalHit hit;
  if (!cast_at_capsule(path, both, half_height, hit)) return none();
  SweepContact out;
  out.kind = SweepContact::Kind::touch;
  out.place = hit.place;
  out.normal = hit.normal;
  out.point = path.at(hit.place) - hit.normal * radius;
  return out;
}

/// The first place from `begin` on where a moving shape within a ball of this size can touch a hull, because it is
/// behind the planes of all faces; infinity if it stays in front of one. That is found in a small part of the time of a
/// distance. A contact is reported up to 4 * tolerance apart.
double first_place_behind_planes(const geometry::Hull& hull, double size, const LocalRay& path, double begin,
                                 double tolerance) {
  const PlaneClip clip = clip_by_planes(hull, path, size * (1 + 0x1p-20) + 16 * tolerance);
  if (clip.enter > clip.leave || clip.leave < path.begin - path.slack) return std::numeric_limits<double>::infinity();
  return std::max(begin, clip.enter);
}

SweepContact ball_at_box(const LocalRay& path, const Vec3d& half_extents, double radius, double begin, double end,
                         double tolerance) {
  const auto gap = [&](double place) {
    const Vec3d centre = path.at(place);
    return gap_of_ball(nearest_in_box(centre, half_extents), centre, radius);
  };
  return advance(gap, path.direction, begin, end, tolerance);
}

}  // namespace

SweepContact sweep_at_convex(const geometry::ShapeView& shapes, ShapeNumber shape, const MovingCore& moving,
                             const LocalRay& path, double most) {
  const geometry::ShapeRow& row = shapes.row(shape);
  const double size[3] = {double{row.size[0]}, double{row.size[1]}, double{row.size[2]}};
  const double own = double{row.bounding_radius}, sizes = own + moving.size();
  if (moving.is_sphere() && (row.kind == ShapeKind::sphere || row.kind == ShapeKind::capsule)) {
    return ball_at_rounded_segment(path, size[0], row.kind == ShapeKind::capsule ? size[1] : 0.0, moving.radius());
  }
  double begin = first_place(path, sizes * (1 + 0x1p-20));
  const double end = std::min(most, path.end + path.slack);
  if (begin > end) return none();
  if (moving.is_sphere() && row.kind == ShapeKind::box) {
    const double radius = moving.radius();
    return ball_at_box(path, {size[0], size[1], size[2]}, radius, begin, end, sweep_tolerance(own, radius, true));
  }
  const ConvexCore fixed(shapes, shape, {});
  const bool is_exact = fixed.is_exact() && moving.is_exact();
  const double tolerance = sweep_tolerance(own, moving.size(), is_exact);
  if (row.kind == ShapeKind::hull) {
    begin = first_place_behind_planes(shapes.hull(row.index_in_kind), moving.size(), path, begin, tolerance);
    if (begin > end) return none();
  }
  ConvexCore placed = moving.at({});
  const auto gap = [&](double place) {
    placed.move_to(path.at(place));
    return gap_between(fixed, placed, end - place + 4 * tolerance);
  };
  return advance(gap, path.direction, begin, end, tolerance);
}

SweepContact cast_at_support(const geometry::ShapeView& shapes, ShapeNumber shape, const LocalRay& ray, double most) {
  const double size = double{shapes.row(shape).bounding_radius};
  const double begin = first_place(ray, size * (1 + 0x1p-20)), end = std::min(most, ray.end + ray.slack);
  if (begin > end) return none();
  const ConvexCore fixed(shapes, shape, {});
  const double tolerance = sweep_tolerance(size, 0, false);
  const auto gap = [&](double place) {
    Placement placement;
    placement.position = ray.at(place);
    return gap_between(fixed, ConvexCore::box({}, placement), end - place + 4 * tolerance);
  };
  return advance(gap, ray.direction, begin, end, tolerance);
}

}  // namespace ringfence::narrow_phase
