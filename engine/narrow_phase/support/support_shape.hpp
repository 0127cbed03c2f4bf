#pragma once

#include <cstddef>

#include "narrow_phase/mesh/mesh_frame.hpp"
#include "narrow_phase/mesh/triangle.hpp"
#include "ringfence/shape.hpp"

namespace ringfence::narrow_phase {

/// The least push of a shape that only its support function describes off a triangle of a mesh, in whose axes `frame`
/// places it. As triangle_penetration, but iterative: good to some 10^-4 of `bounding_radius`, which is the shape's. On
/// libccd: allocates.
Penetration support_penetration(const Triangle& triangle, const SupportFunction& function, const MeshFrame& frame,
                                double bounding_radius, double at_least);

inline constexpr std::size_t max_support_feature = 9;

/// Points of the feature of the shape that is farthest along `direction`, in the mesh's axes; answers how many of the
/// max_support_feature that `out` has room for.
std::size_t support_feature(const SupportFunction& function, const MeshFrame& frame, Vec3d direction, double slack,
                            Vec3d* out);

}  // namespace ringfence::narrow_phase
