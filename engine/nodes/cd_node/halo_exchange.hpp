#pragma once

#include <cstdint>
#include <vector>

#include "base/flat_list.hpp"
#include "base/numbers.hpp"
#include "geometry/bounds.hpp"
#include "messages/header.hpp"
#include "messages/records.hpp"
#include "messages/run.hpp"
#include "nodes/cd_node/node_state.hpp"
#include "nodes/exchange/ghost_updates.hpp"

namespace ringfence::nodes {

/// Keeps the objects of a CD node's region complete: receives the positions of the objects that other roles host, and
/// gives the other nodes those of its own objects that touch their regions.
///
/// A position arrives from the server as `position_update`, or from the node that hosts the object as a ghost update:
/// read in shared memory, or as a `ghost` message. After the positions of a frame every node knows exactly the present
/// objects whose bounds touch its region. So the nodes that know an object from the frame before follow from its bounds
/// in that frame, which its host has in its RegionObjects.
///
/// Only exchange() reads the memory of other nodes.
///
/// Threads: belongs to the CD node. Memory: grows to the largest frame.
class HaloExchange {
 public:
  explicit HaloExchange(NodeState& state);

  /// After NodeState::setup has new peers.
  void assign();
  /// Whether the server can read this node's states in shared memory, so that messages need not contain them.
  bool shares_states() const noexcept;
  /// Whether objects are host-owned: their hosts, not the server, send their positions to the other nodes.
  bool keeps_host_owned() const noexcept { return keeps_host_owned_; }
  /// Whether the server receives host-owned states as replicas, because it cannot read them.
  bool replicates() const noexcept { return sends_messages(); }

  /// Starts the updates of a frame.
  void begin();
  /// Adds the updates about a hosted object with host-owned state, before its entry in RegionObjects is replaced.
  /// `hosted`: its index in Host. `bounds`: of its new pose. `staying`: this node remains the host. `was`: index of the
  /// entry, or RegionObjects::none.
  void add_updates(std::uint32_t hosted, const geometry::Bounds& bounds, bool staying, std::uint32_t was);
  /// After the last update, before the server is notified. Reports the number of updates for each node to the server,
  /// if they are messages. Returns whether that is sent; if not, call it again.
  bool finish_updates();
  /// Sends the updates to the other nodes. Returns whether all are sent; if not, call it again.
  bool send_updates();
  /// After all positions have arrived from the server: applies the updates of the other nodes that can be read in
  /// shared memory. Returns whether all have been applied. In a frame in which the server sends everything there are
  /// none.
  bool receive_updates();
  /// The number of updates that arrive as messages in this frame, from `ghosts_sent`.
  void expect(std::uint64_t updates) noexcept { expected_ = updates; }
  /// Whether updates are still to arrive as messages.
  bool expects_updates() const noexcept { return expected_ != unknown && arrived_ < expected_; }
  /// Applies a `ghost` message of another node.
  void receive(const messages::MessageView& message);
  /// All positions of the frame arrive again, from the server: forgets the updates to be sent and received.
  void discard() noexcept;
  /// Before the node adopts objects again that have changed at the cut: their layers and groups apply from now on. The
  /// other nodes receive the positions of such objects from the server.
  void renew_filters(const messages::MessageView& adoptions);
  /// Applies a `position_update` message of the server.
  void receive_positions(const messages::MessageView& message);
  /// Adds a `region_map` message. After its last part, every object of the region arrives again.
  void receive_map(const messages::MessageView& message);

 private:
  bool sends_messages() const noexcept;
  void read_updates();
  void apply_position(const messages::PositionRecord& record, bool gone);
  void apply_update(const messages::PositionRecord& record, bool gone);
  NextHost next_host(const messages::PositionRecord& record) const noexcept;

  /// What is sent to one node.
  struct Outgoing {
    base::FlatList<GhostUpdates::Update> updates;
    messages::RunSender run;
  };
  static constexpr std::uint64_t unknown = ~std::uint64_t{0};

  NodeState& state_;
  bool keeps_host_owned_ = false;
  base::FlatList<GhostUpdates::Update> received_;  ///< read in shared memory
  std::vector<Outgoing> outgoing_;                 ///< by slot
  std::vector<messages::CountRecord> counts_;
  messages::RunSender counts_run_;
  bool finished_ = false;             ///< finish_updates() was called in this frame
  std::uint64_t expected_ = unknown;  ///< messages: number of updates
  std::uint64_t arrived_ = 0;
  std::vector<std::uint64_t> stamps_;  ///< by node: see regions::for_each_owner
  std::uint64_t stamp_ = 0;
};

}  // namespace ringfence::nodes
