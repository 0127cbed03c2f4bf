#pragma once

#include <algorithm>

#include "geometry/shape_view.hpp"
#include "narrow_phase/query/convex_core.hpp"
#include "narrow_phase/query/mesh_boxes.hpp"
#include "narrow_phase/query/sweep/advance.hpp"

namespace ringfence::narrow_phase {

/// A convex shape with a fixed orientation at changing positions. Refers to the shape.
class MovingCore {
 public:
  /// Precondition: the shape is no mesh. `rotation`: from the shape's axes to those of the frame.
  MovingCore(const geometry::ShapeView& shapes, ShapeNumber shape, const geometry::RotationD& rotation) noexcept
      : shapes_(shapes), shape_(shape), rotation_(rotation) {}

  ConvexCore at(const Vec3d& position) const { return {shapes_, shape_, {rotation_, position}}; }
  /// As ConvexCore::is_exact().
  bool is_exact() const noexcept { return shapes_.row(shape_).kind != ShapeKind::support; }
  bool is_sphere() const noexcept { return shapes_.row(shape_).kind == ShapeKind::sphere; }
  /// Radius of a ball around the origin that contains the shape, metres.
  double size() const noexcept { return double{shapes_.row(shape_).bounding_radius}; }
  /// Radius of a sphere. Precondition: is_sphere().
  double radius() const noexcept { return double{shapes_.row(shape_).size[0]}; }

  /// The box around the shape, its radius included, when its origin is at the frame's origin.
  CornerBox box() const;

 private:
  geometry::ShapeView shapes_;
  ShapeNumber shape_;
  geometry::RotationD rotation_;
};

/// The gap between a fixed core and a moving one, by core_distance(). `limit`, metres: of a gap that is wider only
/// `beyond` is valid.
Gap gap_between(const ConvexCore& fixed, const ConvexCore& moving, double limit);

/// The gap between a point on a fixed shape that is nearest to the centre of a ball, and the ball.
Gap gap_of_ball(const Vec3d& nearest, const Vec3d& centre, double radius) noexcept;

/// The tolerance of advance() for two shapes of these sizes, metres. Support functions return floats.
inline double sweep_tolerance(double size, double other, bool is_exact) noexcept {
  return is_exact ? 0x1p-30 * std::min(size, other) + 0x1p-40 * (size + other) : 0x1p-20 * (size + other);
}

}  // namespace ringfence::narrow_phase
