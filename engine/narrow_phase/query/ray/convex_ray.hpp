#pragma once

#include "geometry/hull.hpp"
#include "geometry/vector.hpp"
#include "narrow_phase/query/ray/hull_planes.hpp"
#include "narrow_phase/query/ray/local_ray.hpp"

namespace ringfence::narrow_phase {

// Rays against single convex shapes, in closed form, on the axes of the shape. Each function sets `hit` and returns
// true if the ray enters the shape at or before its end. Precondition: the ray starts outside.

/// A ball around `centre`.
bool cast_at_sphere(const LocalRay& ray, const Vec3d& centre, double radius, LocalHit& hit) noexcept;
/// A box around the origin. Where the ray enters through an edge, the normal is that of the lowest axis.
bool cast_at_box(const LocalRay& ray, const Vec3d& half_extents, LocalHit& hit) noexcept;
/// All points within `radius` of the segment from -half_height to +half_height on the z axis.
bool cast_at_capsule(const LocalRay& ray, double radius, double half_height, LocalHit& hit) noexcept;
/// A hull. `clip` is that of clip_by_planes(); the planes may be too far out by a float's rounding, so near a sharp
/// edge by more. Then the polygons of the faces decide, whose corners are those of the shape.
bool cast_at_hull(const LocalRay& ray, const geometry::Hull& hull, const PlaneClip& clip, LocalHit& hit) noexcept;

}  // namespace ringfence::narrow_phase
