#pragma once

#include <cstdint>

#include "geometry/mesh.hpp"
#include "narrow_phase/query/ray/local_ray.hpp"
#include "narrow_phase/query/sweep/moving_core.hpp"

namespace ringfence::narrow_phase {

/// Sweeps a convex shape, whose origin follows `path`, against a mesh, on the mesh's axes, up to the place `most`. Sets
/// `triangle` to the one that is touched first; of several at the same place, the one with the lowest number. If the
/// shape overlaps the mesh at the begin of the path, the result is `inside`.
///
/// `most` never changes a contact that is found; see visit_triangles(). Threads: any. No allocation. Throws
/// geometry::SupportFailure. Cost of a contact with a mesh of about 200 triangles, on a way as long as the mesh: 3 µs
/// for a ball, 20 µs for other shapes.
SweepContact sweep_at_mesh(const geometry::Mesh& mesh, const MovingCore& moving, const LocalRay& path, double most,
                           std::uint32_t& triangle);

/// Whether a convex shape at `position` overlaps or touches a mesh. Sets `triangle` to the lowest number of the
/// triangles that it does. As above.
bool overlaps_mesh(const geometry::Mesh& mesh, const MovingCore& shape, const Vec3d& position, std::uint32_t& triangle);

}  // namespace ringfence::narrow_phase
