#pragma once

#include <span>
#include <vector>

#include "gateway/clients/client.hpp"
#include "gateway/clients/object_table.hpp"
#include "gateway/protocol/server_messages.hpp"
#include "ringfence/world.hpp"

namespace ringfence::gateway {

/// Finds what a spectator sees after a frame: all objects whose position is in the ball that it asked for.
class SpectatorView {
 public:
  explicit SpectatorView(ObjectTable& table) : table_(table) {}

  /// Sets the lists of objects of `update`. `objects` are those of the world after the frame.
  void describe(Client& client, std::span<const ObjectView> objects, Stamp now, Update& update);

 private:
  ObjectTable& table_;
  std::vector<std::uint32_t> near_;
};

}  // namespace ringfence::gateway
