#pragma once

#include "geometry/checked_support.hpp"
#include "geometry/hull.hpp"
#include "geometry/shape_view.hpp"
#include "geometry/vector.hpp"

namespace ringfence::narrow_phase {

/// Position and axes of a shape in the frame in which a pair is computed, in double.
struct Placement {
  geometry::RotationD rotation{{{1, 0, 0}, {0, 1, 0}, {0, 0, 1}}};  ///< from the shape's axes to the frame's
  Vec3d position;                                                   ///< of the shape's origin, metres

  Vec3d operator()(Vec3d point) const noexcept { return position + geometry::rotate(rotation, point); }
};

/// A placed convex shape as the search for distances reads it: all points within `radius` of a convex core, which is
/// given by its farthest points. The core of a sphere is a point, that of a capsule a segment; all other cores are the
/// shapes themselves. Refers to the shape; a few hundred bytes on the stack.
class ConvexCore {
 public:
  /// The core of a convex shape. Precondition: it is no mesh.
  ConvexCore(const geometry::ShapeView& shapes, ShapeNumber shape, const Placement& placement);

  /// A triangle, given by its corners in the frame.
  static ConvexCore triangle(const Vec3d corners[3]) noexcept;
  /// A box around the placement's position.
  static ConvexCore box(Vec3d half_extents, const Placement& placement) noexcept;

  /// Places the shape's origin somewhere else. Precondition: it is no triangle.
  void move_to(const Vec3d& position) noexcept { placement_.position = position; }

  /// The point of the core that is farthest along `direction` (not zero, any length), in the frame. Throws
  /// geometry::SupportFailure if the core is a support function that fails.
  Vec3d support(Vec3d direction) const;
  /// A point of the core.
  Vec3d inner_point() const;

  double radius() const noexcept { return radius_; }  ///< metres
  /// Radius of a ball around the shape's origin that contains the core: rounding errors are relative to it.
  double reach() const noexcept { return reach_; }
  bool is_point() const noexcept { return kind_ == Kind::box && points_[0] == Vec3d{}; }
  /// The hull that the core is, or null.
  const geometry::Hull* hull() const noexcept { return hull_; }
  Vec3d to_own_axes(const Vec3d& point) const noexcept {
    return geometry::rotate_inverse(placement_.rotation, point - placement_.position);
  }
  Vec3d to_frame(const Vec3d& own_point) const noexcept { return placement_(own_point); }
  Vec3d turn_to_frame(const Vec3d& own_direction) const noexcept {
    return geometry::rotate(placement_.rotation, own_direction);
  }
  /// Whether support() is exact to double: false for support functions, which return floats.
  bool is_exact() const noexcept { return function_ == nullptr; }

 private:
  enum class Kind { box, hull, triangle, function };  ///< points and segments are boxes

  ConvexCore(Kind kind, const Placement& placement) noexcept : kind_(kind), placement_(placement) {}
  Vec3d local_support(Vec3d direction) const;

  Kind kind_;
  Placement placement_;
  Vec3d points_[3];  ///< box: its half extents; triangle: its corners
  const geometry::Hull* hull_ = nullptr;
  const geometry::CheckedSupport* function_ = nullptr;
  double radius_ = 0, reach_ = 0;
};

}  // namespace ringfence::narrow_phase
