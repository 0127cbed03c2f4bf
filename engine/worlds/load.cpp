#include "worlds/load.hpp"

#include <algorithm>
#include <string>
#include <vector>

#include <fmt/format.h>

#include "ringfence/error.hpp"

namespace ringfence::worlds {

namespace {

/// What a file contains is no user's request: all of it is in the world, and collides.
Quotas unlimited() {
  Quotas quotas;
  quotas.avatars = quotas.colliding_avatars = quotas.updates = quotas.bytes = quotas.spawns = quotas.moves = 0;
  return quotas;
}

}  // namespace

void configure_for(WorldConfig& config, const Scene& scene, std::uint32_t users) {
  config.bounds_min = scene.bounds_min;
  config.bounds_max = scene.bounds_max;
  config.layers = scene.layers;
  config.quotas = unlimited();
  // In the paper's world there are 0.7 contacts and 1.5 candidates per object. Denser worlds grow the buffers once.
  const std::size_t objects = scene.objects.size();
  config.capacities.objects = std::max(config.capacities.objects, objects);
  config.capacities.pairs = std::max(config.capacities.pairs, 4 * objects);
  config.capacities.contacts = std::max(config.capacities.contacts, 2 * objects);
  config.capacities.users = std::max<std::size_t>(config.capacities.users, users);
}

void load_into(World& world, const Scene& scene, std::uint32_t users) {
  std::vector<ShapeId> shapes;
  for (const NamedShape& shape : scene.shapes) {
    try {
      shapes.push_back(world.add_shape(shape.description));
    } catch (const Error& error) {
      throw Error(fmt::format("shape \"{}\": {}", shape.name, error.what()));
    }
  }
  for (std::uint32_t user = 0; user < users; ++user) {
    const Connected connected = world.connect(UserId(user));
    if (connected.status != Status::ok) throw Error(fmt::format("user {}: {}", user, name_of(connected.status)));
  }
  for (ObjectSpec object : scene.objects) {
    object.shape = shapes[object.shape.number()];
    const Spawned spawned = world.spawn(object);
    if (spawned.status != Status::ok) throw Error(fmt::format("object {}: {}", object.number, name_of(spawned.status)));
  }
}

}  // namespace ringfence::worlds
