#pragma once

#include <span>
#include <vector>

#include "gateway/clients/client.hpp"
#include "gateway/clients/object_table.hpp"
#include "gateway/protocol/server_messages.hpp"
#include "ringfence/world.hpp"

namespace ringfence::gateway {

/// Finds what a spectator sees after a frame: all objects whose position is in the ball that it asked for, and the
/// pairs of objects that touch each other there.
class SpectatorView {
 public:
  SpectatorView(const World& world, ObjectTable& table) : world_(world), table_(table) {}

  /// Sets the lists of `update`. `objects` are those of the world after the frame.
  void describe(Client& client, std::span<const ObjectView> objects, Stamp now, Update& update);

 private:
  void add_touching(const Client& client, Update& update) const;

  const World& world_;
  ObjectTable& table_;
  std::vector<std::uint32_t> near_;
};

}  // namespace ringfence::gateway
