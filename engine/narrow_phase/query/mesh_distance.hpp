#pragma once

#include "geometry/mesh.hpp"
#include "narrow_phase/query/core_distance.hpp"

namespace ringfence::narrow_phase {

/// The distance of a mesh and a convex shape, in the mesh's axes, in which the shape is placed. Of several triangles
/// at the same distance, any. See core_distance() for the precision. A mesh is a surface.
///
/// Searches the mesh's tree from the nearest box on, and compares triangles by core_distance(). Threads: any. No
/// allocation. Throws geometry::SupportFailure. Cost: that of a few dozen core distances where the shape is smaller
/// than the mesh.
CoreDistance mesh_distance(const geometry::Mesh& mesh, const ConvexCore& shape);

/// The distance of two meshes, in the axes of the first; `placement` is that of the second.
CoreDistance mesh_distance(const geometry::Mesh& mesh, const geometry::Mesh& other, const Placement& placement);

}  // namespace ringfence::narrow_phase
