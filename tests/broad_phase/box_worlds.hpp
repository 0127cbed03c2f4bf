#pragma once

#include <cstddef>
#include <cstdint>
#include <random>
#include <string>
#include <vector>

#include "geometry/bounds.hpp"

namespace ringfence::broad_phase::test {

/// A kind of world: generates one box at a time. The sizes are such that a few hundred boxes have enough pairs.
struct BoxWorld {
  std::string name;
  geometry::Bounds (*draw)(std::mt19937_64& random);
};

/// From ordinary to hostile: one size, sizes over nine orders of magnitude, everything in one place, on a line, on a
/// plane, outside the bounds, points, plates, rods, giants, grids whose boxes touch exactly, a cluster in an empty
/// world.
const std::vector<BoxWorld>& box_worlds();

std::vector<geometry::Bounds> draw_boxes(const BoxWorld& world, std::size_t count, std::mt19937_64& random);

}  // namespace ringfence::broad_phase::test
