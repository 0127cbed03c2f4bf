#pragma once

#include <cstdint>

#include "ringfence/shape.hpp"

namespace ringfence::worlds {

/// A closed surface like a rock's, about one metre in radius and centred near the origin: a ball of 20 `frequency`²
/// triangles (a subdivided icosahedron), pulled in and out by bumps and craters that `seed` and `index` draw, then
/// scaled on each axis by 0.6 to 1.2. Every point is seen from the origin. Outward sides are anticlockwise.
///
/// A pure function with the same bits on every machine: +, -, *, / and square roots only. `frequency` is 1 to 223.
TriangleMesh make_asteroid(std::uint64_t seed, std::uint32_t index, std::uint32_t frequency);

/// The volume inside a closed surface whose outward sides are anticlockwise, in cubic metres.
double volume_inside(const TriangleMesh& mesh);

}  // namespace ringfence::worlds
