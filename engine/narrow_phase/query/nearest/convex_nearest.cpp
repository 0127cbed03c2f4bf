#include "narrow_phase/query/nearest/convex_nearest.hpp"

#include <algorithm>
#include <cmath>

#include "geometry/hull.hpp"
#include "geometry/vector.hpp"
#include "narrow_phase/query/convex_core.hpp"
#include "narrow_phase/query/core_distance.hpp"
#include "narrow_phase/query/hull_features.hpp"
#include "narrow_phase/query/hull_point_distance.hpp"

namespace ringfence::narrow_phase {
namespace {

double squared(const Vec3d& p) noexcept { return dot(p, p); }

/// The distance of the point from the shape's core, with the point as b.
CoreDistance distance_of_point(const ConvexCore& core, const Vec3d& point) {
  Placement placement;
  placement.position = point;
  return core_distance(core, ConvexCore::box({}, placement), infinity);
}

}  // namespace

bool contains(const geometry::ShapeView& shapes, ShapeNumber shape, const Vec3d& p) {
  const geometry::ShapeRow& row = shapes.row(shape);
  const double size[3] = {double{row.size[0]}, double{row.size[1]}, double{row.size[2]}};
  switch (row.kind) {
    case ShapeKind::sphere:
      return squared(p) <= size[0] * size[0];
    case ShapeKind::box:
      return std::abs(p.x) <= size[0] && std::abs(p.y) <= size[1] && std::abs(p.z) <= size[2];
    case ShapeKind::capsule:
      return squared(p - Vec3d{0, 0, std::clamp(p.z, -size[1], size[1])}) <= size[0] * size[0];
    case ShapeKind::hull:
      return hull_contains(shapes, shape, p, farthest_plane(shapes.hull(row.index_in_kind), p));
    case ShapeKind::support:
      return distance_of_point(ConvexCore(shapes, shape, {}), p).kind == CoreDistance::Kind::touch;
    case ShapeKind::mesh:
      break;
  }
  return false;
}

// The planes of the faces are precise to a few float steps, and the facets that a face joins to 10^-6 of the size.
bool hull_contains(const geometry::ShapeView& shapes, ShapeNumber shape, const Vec3d& p, double farthest) {
  const double size = double{shapes.row(shape).bounding_radius};
  if (farthest > 0x1p-40 * size) return false;
  if (farthest < -0x1p-18 * size) return true;
  return distance_of_point(ConvexCore(shapes, shape, {}), p).kind == CoreDistance::Kind::touch;
}

Vec3d nearest_in_box(const Vec3d& p, const Vec3d& half) noexcept {
  return {std::clamp(p.x, -half.x, half.x), std::clamp(p.y, -half.y, half.y), std::clamp(p.z, -half.z, half.z)};
}

Vec3d nearest_in_convex(const geometry::ShapeView& shapes, ShapeNumber shape, const Vec3d& p) {
  const geometry::ShapeRow& row = shapes.row(shape);
  const double size[3] = {double{row.size[0]}, double{row.size[1]}, double{row.size[2]}};
  switch (row.kind) {
    case ShapeKind::box:
      return nearest_in_box(p, {size[0], size[1], size[2]});
    case ShapeKind::sphere:
    case ShapeKind::capsule: {
      const Vec3d centre{0, 0, row.kind == ShapeKind::capsule ? std::clamp(p.z, -size[1], size[1]) : 0.0};
      const Vec3d outwards = p - centre;
      const double away = length(outwards);
      return away <= size[0] ? p : centre + outwards * (size[0] / away);
    }
    default: {
      const ConvexCore core(shapes, shape, {});
      CoreDistance found;
      if (core.hull() != nullptr && hull_point_distance(core, p, 0, infinity, found)) return found.on_a;
      if (contains(shapes, shape, p)) return p;
      found = distance_of_point(core, p);
      return found.kind == CoreDistance::Kind::touch ? p : found.on_a;
    }
  }
}

Vec3d nearest_on_segment(const Vec3d& point, const Vec3d& a, const Vec3d& b) noexcept {
  const Vec3d along = b - a;
  const double length_squared = squared(along);
  if (!(length_squared > 0)) return a;
  const double part = dot(point - a, along) / length_squared;
  return part <= 0 ? a : part >= 1 ? b : a + along * part;
}

Vec3d nearest_in_triangle(const Vec3d& p, const Vec3d& a, const Vec3d& b, const Vec3d& c) noexcept {
  Vec3d best = nearest_on_segment(p, a, b);
  double least = squared(p - best);
  const auto consider = [&](const Vec3d& other) {
    const double distance = squared(p - other);
    if (distance < least) least = distance, best = other;
  };
  consider(nearest_on_segment(p, b, c));
  consider(nearest_on_segment(p, c, a));
  const Vec3d ab = b - a, ac = c - a, normal = cross(ab, ac), from_a = p - a;
  const double area = squared(normal);
  const double at_b = dot(cross(from_a, ac), normal), at_c = dot(cross(ab, from_a), normal);
  // With positive weights the point is in the triangle, also where rounding has made the weights wrong.
  if (at_b > 0 && at_c > 0 && at_b + at_c < area) consider(a + ab * (at_b / area) + ac * (at_c / area));
  return best;
}

}  // namespace ringfence::narrow_phase
