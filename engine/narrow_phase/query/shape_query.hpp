#pragma once

#include <cstddef>
#include <cstdint>

#include "geometry/shape_view.hpp"
#include "narrow_phase/query/ray/placed_rays.hpp"
#include "narrow_phase/query/shape_hit.hpp"
#include "ringfence/pose.hpp"

namespace ringfence::narrow_phase {

// Queries against one shape at one pose. All functions are pure: the answer depends on the arguments only, with the
// same bits on every machine. They compute in double, on axes of the shape, after a subtraction of positions; so they
// are as precise far from the origin as the positions are.
//
// Poses are as in Body: finite, with unit quaternions. Shapes are of any kind unless stated. Surfaces belong to shapes:
// touching counts. Threads: any; no state between calls. No allocation, except for what a support function does itself.
// Failure: geometry::SupportFailure if a support function fails.

/// Whether a ray hits a shape, and where first. Hits of a fraction above `limit` (0 to 1) do not count; `limit` never
/// changes the bits of a hit that does. `hit` is set only if the result is true.
///
/// Exact but for rounding, about 10^-15 of the lengths involved, for sphere, box, capsule and mesh; 10^-6 of the size
/// for hulls; 10^-4 for support functions. A ray that runs within a triangle's plane does not hit that triangle. A ray
/// whose displacement is zero hits what contains its start; a mesh if the start is on its surface, but for rounding.
bool cast_ray(const geometry::ShapeView& shapes, ShapeNumber shape, const Pose& pose, const Ray& ray, double limit,
              ShapeHit& hit);
/// The same for a ray that has been placed on the axes of the shape: number `i` of `placed`, with the bounding radius
/// of the shape as its size.
bool cast_ray(const geometry::ShapeView& shapes, ShapeNumber shape, const PlacedRays& placed, std::size_t i,
              const Ray& ray, double limit, ShapeHit& hit);

/// A convex shape that is swept or that overlaps: one of any table, with its orientation.
struct QueryShape {
  geometry::ShapeView shapes;
  ShapeNumber shape = 0;  ///< no mesh
  Quat orientation;       ///< a unit quaternion
};

/// Whether a convex shape, whose origin moves along `path` with a fixed orientation, touches a shape, and where first.
/// `limit` and `hit` as in cast_ray(). If the displacement is zero, overlaps() decides.
///
/// A reported contact is at most 10^-8 of the smaller size plus 10^-11 of the larger apart, and none is missed; 10^-5
/// of both sizes with support functions. A shape that moves along a surface or away from it does not touch it.
bool sweep_shape(const geometry::ShapeView& shapes, ShapeNumber shape, const Pose& pose, const QueryShape& moving,
                 const Ray& path, double limit, ShapeHit& hit);
/// The same for a path that has been placed on the axes of the shape, with the bounding radii of both shapes as its
/// size.
bool sweep_shape(const geometry::ShapeView& shapes, ShapeNumber shape, const PlacedRays& placed, std::size_t i,
                 const QueryShape& moving, const Ray& path, double limit, ShapeHit& hit);

/// Whether a convex shape at `position` overlaps or touches a shape: whether the two would be in contact, as
/// NarrowPhase says, which computes in float where sizes allow. With meshes and support functions as precise as
/// sweep_shape(). If the shape is a mesh, sets `triangle` to the lowest
/// number of the triangles that it overlaps or touches, else to 0.
bool overlaps(const geometry::ShapeView& shapes, ShapeNumber shape, const Pose& pose, const QueryShape& query,
              const Vec3d& position, std::uint32_t& triangle);

/// Finds the point of a shape that is nearest to `point` (metres, world), if its distance is at most `limit` metres
/// (may be infinite). Returns whether there is one. A mesh has no inside. Precision as for rays. `limit` never changes
/// the bits of a result.
bool find_nearest(const geometry::ShapeView& shapes, ShapeNumber shape, const Pose& pose, const Vec3d& point,
                  double limit, NearestPoint& nearest);
/// The same for a point that has been placed on the axes of the shape, as a ray of no length.
bool find_nearest(const geometry::ShapeView& shapes, ShapeNumber shape, const PlacedRays& placed, std::size_t i,
                  const Vec3d& point, double limit, NearestPoint& nearest);

}  // namespace ringfence::narrow_phase
