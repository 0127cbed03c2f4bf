#pragma once

#include <span>
#include <vector>

#include "gateway/clients/client.hpp"
#include "gateway/clients/object_table.hpp"
#include "gateway/clients/static_objects.hpp"
#include "gateway/protocol/server_messages.hpp"
#include "ringfence/world.hpp"

namespace ringfence::gateway {

/// Finds what a player sees after a frame, and which of it its client has to receive.
///
/// A player sees the objects whose position is within WorldConfig::interest of its avatar, and the static objects whose
/// bounding ball comes so near. The states are those that its user node received (World::seen_by).
class PlayerView {
 public:
  PlayerView(const World& world, ObjectTable& table, const StaticObjects& static_objects)
      : world_(world), table_(table), static_objects_(static_objects) {}

  /// Sets the avatar, the lists of objects and the contacts of `update`.
  void describe(Client& client, Stamp now, Update& update);

 private:
  void find_near(const Client& client, const Vec3d& centre);

  const World& world_;
  ObjectTable& table_;
  const StaticObjects& static_objects_;
  std::vector<std::uint32_t> near_;
};

/// Sorts indices into the table by the objects' numbers, and removes repeated ones.
void sort_by_number(std::vector<std::uint32_t>& indices, const ObjectTable& table);

}  // namespace ringfence::gateway
