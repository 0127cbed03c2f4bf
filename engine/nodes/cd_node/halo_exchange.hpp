#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "base/numbers.hpp"
#include "geometry/bounds.hpp"
#include "messages/header.hpp"
#include "messages/records.hpp"
#include "nodes/cd_node/node_state.hpp"
#include "nodes/exchange/ghost_updates.hpp"

namespace ringfence::nodes {

/// Keeps the objects of a CD node's region complete: receives the positions of the objects that other roles host, and
/// gives the other nodes those of its own objects that touch their regions.
///
/// A position arrives from the server as `position_update`, or from the node that hosts the object as a ghost update,
/// which NodeExchange carries. After the positions of a frame every node knows exactly the present objects whose bounds
/// touch its region. So the nodes that know an object from the frame before follow from its bounds in that frame, which
/// its host has in its RegionObjects.
///
/// Threads: belongs to the CD node. Memory: grows to the largest frame.
class HaloExchange {
 public:
  explicit HaloExchange(NodeState& state);

  /// After NodeState::assign().
  void assign() { stamps_.assign(state_.setup.slots(), 0); }
  /// Starts the updates of a frame.
  void begin() { state_.contacts.ghost_updates.start(state_.frame); }
  /// Adds the updates about a hosted object with host-owned state, before its entry in RegionObjects is replaced.
  /// `hosted`: its index in Host. `bounds`: of its new pose. `staying`: this node remains the host. `was`: index of the
  /// entry, or RegionObjects::none.
  void add_updates(std::uint32_t hosted, const geometry::Bounds& bounds, bool staying, std::uint32_t was);
  /// Applies updates of other nodes that list them for this node; called while their records may be read.
  void apply(std::span<const GhostUpdates::Update> updates);
  /// Applies a `ghost` message of another node.
  void apply(const messages::MessageView& message);
  /// Before the node adopts objects again that have changed at the cut: their layers and groups apply from now on. The
  /// other nodes receive the positions of such objects from the server.
  void renew_filters(const messages::MessageView& adoptions);
  /// Applies a `position_update` message of the server.
  void receive_positions(const messages::MessageView& message);
  /// Adds a `region_map` message. After its last part, every object of the region arrives again.
  void receive_map(const messages::MessageView& message);

 private:
  void apply_position(const messages::PositionRecord& record, bool gone);
  void apply_update(const messages::PositionRecord& record, bool gone);
  NextHost next_host(const messages::PositionRecord& record) const noexcept;

  NodeState& state_;
  std::vector<std::uint64_t> stamps_;  ///< by node: see regions::for_each_owner
  std::uint64_t stamp_ = 0;
};

}  // namespace ringfence::nodes
