#include "narrow_phase/query/convex_core.hpp"

#include <algorithm>
#include <cassert>
#include <cmath>

#include "narrow_phase/query/hull_features.hpp"

namespace ringfence::narrow_phase {

ConvexCore::ConvexCore(const geometry::ShapeView& shapes, ShapeNumber shape, const Placement& placement)
    : kind_(Kind::box), placement_(placement) {
  const geometry::ShapeRow& row = shapes.row(shape);
  assert(row.kind != ShapeKind::mesh);
  reach_ = double{row.bounding_radius};
  switch (row.kind) {
    case ShapeKind::sphere:
      radius_ = double{row.size[0]};
      reach_ = 0;
      break;
    case ShapeKind::capsule:
      radius_ = double{row.size[0]};
      reach_ = double{row.size[1]};
      points_[0] = {0, 0, double{row.size[1]}};
      break;
    case ShapeKind::hull:
      kind_ = Kind::hull;
      hull_ = &shapes.hull(row.index_in_kind);
      break;
    case ShapeKind::support:
      kind_ = Kind::function;
      function_ = &shapes.support(row.index_in_kind);
      break;
    default:
      points_[0] = {double{row.size[0]}, double{row.size[1]}, double{row.size[2]}};
      break;
  }
}

ConvexCore ConvexCore::triangle(const Vec3d corners[3]) noexcept {
  ConvexCore core(Kind::triangle, {});
  for (int i = 0; i < 3; ++i) {
    core.points_[i] = corners[i];
    core.reach_ = std::max(core.reach_, length(corners[i]));
  }
  return core;
}

ConvexCore ConvexCore::box(Vec3d half_extents, const Placement& placement) noexcept {
  ConvexCore core(Kind::box, placement);
  core.points_[0] = half_extents;
  core.reach_ = length(half_extents);
  return core;
}

Vec3d ConvexCore::local_support(Vec3d d) const {
  switch (kind_) {
    case Kind::box:
      return {std::copysign(points_[0].x, d.x), std::copysign(points_[0].y, d.y), std::copysign(points_[0].z, d.z)};
    case Kind::hull:
      return to_double(hull_->vertex(farthest_vertex(*hull_, d)));
    case Kind::triangle: {
      const double p = dot(d, points_[0]), q = dot(d, points_[1]), r = dot(d, points_[2]);
      return p >= q && p >= r ? points_[0] : q >= r ? points_[1] : points_[2];
    }
    default:
      // Scaled, because a function receives floats.
      return to_double(function_->support(to_float(d * (1 / length(d)))));
  }
}

Vec3d ConvexCore::support(Vec3d direction) const {
  if (kind_ == Kind::triangle) return local_support(direction);
  return placement_(local_support(geometry::rotate_inverse(placement_.rotation, direction)));
}

Vec3d ConvexCore::inner_point() const {
  if (kind_ == Kind::hull) return placement_(to_double(hull_->centroid()));
  if (kind_ == Kind::function) return placement_(to_double(function_->centre()));
  return kind_ == Kind::triangle ? (points_[0] + points_[1] + points_[2]) * (1.0 / 3) : placement_.position;
}

}  // namespace ringfence::narrow_phase
