#pragma once

#include "ringfence/world.hpp"
#include "worlds/scene.hpp"

namespace ringfence::worlds {

/// Sets bounds and layers of `config` to those of `scene`, raises its capacities to what `scene` needs, and removes the
/// quotas of users.
void configure_for(WorldConfig& config, const Scene& scene, std::uint32_t users);

/// Registers the shapes of `scene`, connects users 0 to `users` - 1 and spawns the objects. They exist from the next
/// frame on.
///
/// Preconditions: `world` has no shapes, users or objects; `users` is at least users_of(scene). Throws Error that names
/// the shape, user or object that the world refuses.
void load_into(World& world, const Scene& scene, std::uint32_t users);

}  // namespace ringfence::worlds
