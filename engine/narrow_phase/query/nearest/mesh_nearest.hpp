#pragma once

#include <cstdint>

#include "geometry/mesh.hpp"

namespace ringfence::narrow_phase {

/// Finds the point of a mesh that is nearest to `point`, on the mesh's axes, if its distance is at most `limit` metres
/// (may be infinite). Of several triangles at the same distance, the one with the lowest number. Returns whether there
/// is one. `limit` never changes a result that is found; see visit_triangles(). Threads: any. No allocation.
bool nearest_in_mesh(const geometry::Mesh& mesh, const Vec3d& point, double limit, Vec3d& nearest, double& distance,
                     std::uint32_t& triangle);

}  // namespace ringfence::narrow_phase
