#pragma once

#include <cstdint>

#include "geometry/mesh.hpp"
#include "narrow_phase/query/ray/local_ray.hpp"

namespace ringfence::narrow_phase {

/// Finds the first triangle that a ray hits, from either side, at or before `most`, a place on the ray. Of several at
/// the same place, the one with the lowest number. Sets `hit` and `triangle` and returns true if there is one.
///
/// `most` never changes a hit that is found; see visit_triangles(). The normal is that of the side from which the ray
/// comes. Threads: any. No allocation. Cost: 0.2 to 1 µs for 10^4 to 10^6 triangles in the cache.
bool cast_at_mesh(const LocalRay& ray, const geometry::Mesh& mesh, double most, LocalHit& hit, std::uint32_t& triangle);

}  // namespace ringfence::narrow_phase
