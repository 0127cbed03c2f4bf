#pragma once

#include "ringfence/world.hpp"
#include "worlds/scene.hpp"

namespace ringfence::worlds {

/// Bounds, layers and capacities of a configuration as a scene needs them.
void configure_for(WorldConfig& config, const Scene& scene, UserNumber users);

/// Registers the scene's shapes, connects users 0 to `users` - 1 and spawns the objects, for the next frame.
///
/// `world` is new: without shapes, users and objects. `users` is at least users_of(scene). Throws Error naming the
/// shape, user or object that the world refuses.
void load_into(World& world, const Scene& scene, UserNumber users);

}  // namespace ringfence::worlds
