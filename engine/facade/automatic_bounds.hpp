#pragma once

#include <span>

#include "nodes/server/request.hpp"
#include "ringfence/config.hpp"
#include "ringfence/pose.hpp"

namespace ringfence::facade {

/// The bounds of a world in metres, a cube.
struct WorldBounds {
  Vec3d min, max;
};

/// Whether the configuration leaves the bounds to the World.
bool has_automatic_bounds(const WorldConfig& config) noexcept;

/// Bounds for the objects that `requests` spawn; a function of their positions alone. Of each axis the cube contains
/// the objects that are no further from the middle half of them than 16 times the length of that half. So a few objects
/// far away do not widen it. Its side is an eighth longer than these objects need, and at least 16 m. Returns false
/// without a spawn.
bool choose_bounds(std::span<const nodes::Request> requests, WorldBounds& bounds);
/// The same for objects at these positions.
bool choose_bounds(std::span<const Vec3d> positions, WorldBounds& bounds);

}  // namespace ringfence::facade
