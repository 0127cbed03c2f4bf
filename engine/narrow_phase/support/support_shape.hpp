#pragma once

#include <cstddef>

#include "geometry/checked_support.hpp"
#include "narrow_phase/mesh/mesh_frame.hpp"
#include "narrow_phase/mesh/triangle.hpp"

namespace ringfence::narrow_phase {

/// The penetration of a triangle of a mesh by a shape that is described by a support function; `frame` places the shape
/// in the mesh's axes. As triangle_penetration, but iterative: precise to about 10^-4 of `bounding_radius`, the
/// shape's. Uses libccd, which allocates. Throws geometry::SupportFailure, as support_feature does.
Penetration support_penetration(const Triangle& triangle, const geometry::CheckedSupport& function,
                                const MeshFrame& frame, double bounding_radius, double at_least);

inline constexpr std::size_t max_support_feature = 9;

/// Writes the points of the shape's feature that is farthest along `direction`, in the mesh's axes. Returns their
/// number, at most max_support_feature, for which `out` has room.
std::size_t support_feature(const geometry::CheckedSupport& function, const MeshFrame& frame, Vec3d direction,
                            double slack, Vec3d* out);

}  // namespace ringfence::narrow_phase
