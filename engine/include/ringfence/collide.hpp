#pragma once

#include <memory>
#include <optional>

#include "ringfence/error.hpp"
#include "ringfence/pose.hpp"
#include "ringfence/shape.hpp"
#include "ringfence/status.hpp"

namespace ringfence {

struct CollideResult;
struct DistanceResult;

/// A shape that is prepared once for `collide` and `distance`, which need no World.
///
/// Immutable. A copy shares the prepared data and costs as much as a std::shared_ptr; a prepared shape that was moved
/// from can only be assigned to or destroyed. Threads: any number may use one prepared shape, and its copies, at the
/// same time.
class PreparedShape {
 public:
  /// Checks and prepares a shape, as World::add_shape does. Throws Error with the reason, also if a support function
  /// throws, and std::bad_alloc.
  explicit PreparedShape(const ShapeDescription& description);

  ShapeKind kind() const noexcept;
  /// Radius in metres of a ball around the shape's origin that contains the shape.
  double bounding_radius() const noexcept;

 private:
  friend CollideResult collide(const PreparedShape&, const Pose&, const PreparedShape&, const Pose&) noexcept;
  friend DistanceResult distance(const PreparedShape&, const Pose&, const PreparedShape&, const Pose&) noexcept;
  struct Implementation;
  std::shared_ptr<const Implementation> implementation_;
};

/// Where two shapes overlap or touch. The fields are those of Contact.
struct ContactGeometry {
  Vec3f normal;     ///< unit vector from a to b
  float depth = 0;  ///< metres, >= 0: the least translation of b along `normal` that separates the two
  Vec3d point;      ///< world position midway between the two surfaces at the deepest place, metres
};

/// Result of `collide`.
struct CollideResult {
  /// ok; not_finite or not_unit if a pose is refused; support_failed if a support function threw or returned an invalid
  /// point.
  Status status = Status::ok;
  std::optional<ContactGeometry> contact;  ///< none if the two are apart, or if status is not ok
};

/// The contact of two placed shapes, as a World finds it: the same bits as Contact::normal, depth and point of a pair
/// of objects with these shapes and poses, of which `a` has the lower number.
///
/// A pose is valid under the conditions of World::place: finite, at most `farthest_coordinate`, orientation within
/// 10^-3 of unit length (it is normalised). Computes in the default floating-point environment and restores the
/// caller's. Threads: any. Allocates nothing, except libccd for support shapes. Cost: that of one pair in
/// docs/performance.md, plus about 0.1 µs.
[[nodiscard]] CollideResult collide(const PreparedShape& a, const Pose& pose_a, const PreparedShape& b,
                                    const Pose& pose_b) noexcept;

/// Result of `distance`.
struct DistanceResult {
  Status status = Status::ok;  ///< as in CollideResult; the other fields are only valid with ok
  double distance = 0;         ///< metres, >= 0; 0 where the shapes overlap or touch
  Vec3d normal;                ///< unit vector from a to b along the shortest connection; zero where `distance` is 0
  Vec3d point_a, point_b;      ///< world positions of the closest points; where `distance` is 0, one common point
};

/// The distance of two placed shapes of any kinds, in double precision. A mesh is a surface: a shape that is inside it
/// without touching it has a distance.
///
/// Error: at most 10^-12 of the two bounding radii together plus 10^-14 of the distance; with a support function, which
/// returns floats, 10^-5 of the bounding radii. `point_a` lies on a and `point_b` on b with the same error, plus the
/// spacing of doubles at their positions, and so far apart as `distance` says. Where several pairs of points are
/// closest (parallel faces), they are any of them. Within the error of 0, `distance` may be 0 for shapes that are
/// apart, and not 0 for shapes that touch; `collide` has a wider band, because it computes in float.
///
/// Poses, floating point, threads and memory as for `collide`. Cost: 0.3 to 3 µs for convex shapes, 1 to 60 µs with
/// a mesh of some hundred triangles.
/// Method: Gilbert, Johnson and Keerthi (1988), with a proof of the result and a search in twice the precision where
/// rounding prevents it; meshes by their bounding-volume trees.
[[nodiscard]] DistanceResult distance(const PreparedShape& a, const Pose& pose_a, const PreparedShape& b,
                                      const Pose& pose_b) noexcept;

}  // namespace ringfence
