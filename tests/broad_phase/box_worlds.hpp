#pragma once

#include <cstddef>
#include <cstdint>
#include <random>
#include <string>
#include <vector>

#include "geometry/bounds.hpp"

namespace ringfence::broad_phase::test {

/// A kind of world: draws one box at a time. Sizes are chosen so that a few hundred boxes have pairs enough.
struct BoxWorld {
  std::string name;
  geometry::Bounds (*draw)(std::mt19937_64& random);
};

/// From the ordinary to the malicious: one size, sizes of nine orders of magnitude, everything in one spot, on a line,
/// on a plane, beyond the bounds, points, plates, rods, giants, grids that touch exactly, a spot in an empty world.
const std::vector<BoxWorld>& box_worlds();

std::vector<geometry::Bounds> draw_boxes(const BoxWorld& world, std::size_t count, std::mt19937_64& random);

}  // namespace ringfence::broad_phase::test
