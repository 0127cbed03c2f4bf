#pragma once

#include <cstddef>

#include "geometry/checked_support.hpp"
#include "narrow_phase/mesh/mesh_frame.hpp"
#include "narrow_phase/mesh/triangle.hpp"

namespace ringfence::narrow_phase {

/// The penetration of a triangle of a mesh by a shape that has a support function. `frame` places the shape in the
/// mesh's axes; `bounding_radius` is that of the shape, in metres. Has the contract of triangle_penetration, but is
/// iterative: the result is precise to about 10^-4 of `bounding_radius`. Uses libccd, which allocates. Throws
/// geometry::SupportFailure. Any thread may call it.
Penetration support_penetration(const Triangle& triangle, const geometry::CheckedSupport& function,
                                const MeshFrame& frame, double bounding_radius, double at_least);

/// Largest number of points that support_feature() writes.
inline constexpr std::size_t max_support_feature = 9;

/// Writes the points of the feature of the shape that is farthest along `direction`: points at most `slack` metres
/// below the farthest. `direction` (a unit vector) and the points are in the mesh's axes. Returns the number of points.
/// `out` has room for max_support_feature points. Throws geometry::SupportFailure; allocates nothing. Any thread may
/// call it.
std::size_t support_feature(const geometry::CheckedSupport& function, const MeshFrame& frame, Vec3d direction,
                            double slack, Vec3d* out);

}  // namespace ringfence::narrow_phase
