#pragma once

#include <cstdint>
#include <vector>

#include "base/flat_list.hpp"
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
/// A position arrives from the server as `position_update`, or from a node that shares memory as a ghost update. After
/// the positions of a frame every node knows exactly the present objects whose bounds touch its region. So the nodes
/// that know an object from the frame before follow from its bounds in that frame, which its host has in its
/// RegionObjects.
///
/// Only these functions use the memory of other nodes: the constructor, assign(), begin(), add_updates(),
/// finish_updates(), receive_updates() and receive_map().
///
/// Threads: belongs to the CD node. Memory: grows to the largest frame.
class HaloExchange {
 public:
  explicit HaloExchange(NodeState& state);

  /// After NodeState::setup has new peers.
  void assign();
  /// Whether the server can read this node's states in shared memory, so that messages need not contain them.
  bool shares_states() const noexcept;
  /// Whether the server and all peers can, so that host-owned states need not be sent.
  bool keeps_host_owned() const noexcept { return keeps_host_owned_; }

  /// Starts the updates of a frame.
  void begin();
  /// Adds the updates about a hosted object with host-owned state, before its entry in RegionObjects is replaced.
  /// `hosted`: its index in Host. `bounds`: of its new pose. `staying`: this node remains the host. `was`: index of the
  /// entry, or RegionObjects::none.
  void add_updates(std::uint32_t hosted, const geometry::Bounds& bounds, bool staying, std::uint32_t was);
  /// After the last update, before the server is notified.
  void finish_updates();
  /// Applies the updates from peers, after all positions have arrived from the server. Does nothing in a frame in which
  /// the server sends everything: then the gate is barred.
  void receive_updates();
  /// Applies a `position_update` message of the server.
  void receive_positions(const messages::MessageView& message);
  /// Adds a `region_map` message. After its last part, every object of the region arrives again.
  void receive_map(const messages::MessageView& message);

 private:
  void apply_position(const messages::PositionRecord& record, bool gone);
  void apply_update(const messages::PositionRecord& record, bool gone);
  NextHost next_host(const messages::PositionRecord& record) const noexcept;

  NodeState& state_;
  bool keeps_host_owned_ = false;
  base::FlatList<GhostUpdates::Update> received_;  ///< updates of all peers
  std::vector<std::uint64_t> stamps_;              ///< by node: see regions::for_each_owner
  std::uint64_t stamp_ = 0;
};

}  // namespace ringfence::nodes
