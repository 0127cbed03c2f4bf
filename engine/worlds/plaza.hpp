#pragma once

#include <cstdint>

#include "worlds/scene.hpp"

namespace ringfence::worlds {

/// A square for players to walk on, which `ringfence serve` generates.
struct PlazaOptions {
  std::uint32_t objects = 2000;  ///< 0 to 10^6, without avatars
  std::uint64_t seed = 1;
};

/// Generates a plain square with things on it: crates, walls, pillars and rocks that do not move (half of the objects),
/// balls, crates and barrels that can be pushed (a fifth), and figures that walk by themselves (the others). Each
/// object has about 30 square metres. The middle, 8 m around (0, 0), is free. It has no avatars and no users.
///
/// Everything stands on z = 0 and moves in the plane, by the motion model Walk. The objects are numbered from 1 in
/// random places that do not overlap.
///
/// A pure function of the options. Throws Error that names an option that is out of range.
Scene make_plaza(const PlazaOptions& options);

}  // namespace ringfence::worlds
