#pragma once

#include <cstdint>

#include "geometry/mesh.hpp"
#include "narrow_phase/query/ray/local_ray.hpp"

namespace ringfence::narrow_phase {

/// Finds the first triangle that a ray hits, from either side, at or before `most`, a place on the ray. Of several at
/// the same place, the one with the lowest number. Sets `hit` and `triangle` and returns true if there is one.
///
/// `most` never changes a hit that is found; see visit_triangles(). The normal is that of the side from which the ray
/// comes. Threads: any. No allocation. Cost: 0.5 µs for 100 triangles, 2 µs for
/// a ray of 50 m over a terrain of 500,000 triangles of 1 m.
bool cast_at_mesh(const LocalRay& ray, const geometry::Mesh& mesh, double most, LocalHit& hit, std::uint32_t& triangle);

}  // namespace ringfence::narrow_phase
