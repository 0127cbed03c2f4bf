#pragma once

#include <cstdint>

#include "ringfence/shape.hpp"

namespace ringfence::worlds {

/// Generates a closed, rock-like triangle mesh of about 1 m radius around the origin.
///
/// Method: an icosahedron is subdivided into 20 x `frequency`² triangles and projected onto a sphere. The surface is
/// displaced by bumps and craters, and scaled on each axis by 0.6 to 1.2. `seed` and `index` select the bumps and the
/// scale. The surface is star-shaped: every surface point is visible from the origin. Faces are wound anticlockwise
/// seen from outside.
///
/// Throws Error unless `frequency` is 1 to 223. A pure function with the same bits on every machine, because its only
/// operations are +, -, *, / and square roots. May be called from any thread.
TriangleMesh make_asteroid(std::uint64_t seed, std::uint32_t index, std::uint32_t frequency);

/// Volume that a closed mesh encloses, in cubic metres. Precondition: faces are wound anticlockwise seen from outside.
double volume_inside(const TriangleMesh& mesh);

}  // namespace ringfence::worlds
