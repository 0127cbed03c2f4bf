#pragma once

#include "geometry/shape_view.hpp"
#include "geometry/vector.hpp"

namespace ringfence::narrow_phase {

// Points against single convex shapes, on the axes of the shape.

/// Whether a sphere, box, capsule, hull or support function contains a point, its surface included; false for a mesh,
/// which has no inside. Exact but for rounding; a hull is tested by the planes of its faces, and within a float's
/// rounding of a plane by core_distance(). Throws geometry::SupportFailure.
bool contains(const geometry::ShapeView& shapes, ShapeNumber shape, const Vec3d& point);

/// contains() for a hull, from the largest distance of the point from the plane of a face, which is negative behind all
/// planes.
bool hull_contains(const geometry::ShapeView& shapes, ShapeNumber shape, const Vec3d& point, double farthest);

/// The point of a sphere, box, capsule, hull or support function that is nearest to `point`; `point` itself if the
/// shape contains it. Closed form for the first three; core_distance() for the others. Throws geometry::SupportFailure.
Vec3d nearest_in_convex(const geometry::ShapeView& shapes, ShapeNumber shape, const Vec3d& point);

/// The point of a segment that is nearest to `point`.
Vec3d nearest_on_segment(const Vec3d& point, const Vec3d& a, const Vec3d& b) noexcept;

/// The point of a triangle that is nearest to `point`.
Vec3d nearest_in_triangle(const Vec3d& point, const Vec3d& a, const Vec3d& b, const Vec3d& c) noexcept;

/// The point of a box around the origin that is nearest to `point`.
Vec3d nearest_in_box(const Vec3d& point, const Vec3d& half_extents) noexcept;

}  // namespace ringfence::narrow_phase
