#pragma once

#include <cstddef>
#include <cstdint>

#include "nodes/cd_node/region_objects.hpp"
#include "nodes/exchange/server/server_exchange.hpp"
#include "nodes/server/server_state.hpp"

namespace ringfence::nodes {

/// The states S(k) of all objects for the server: in its table, or for host-owned objects in the memory of their hosts,
/// from which they are stored in the table when the server needs them.
///
/// Threads: belongs to the server role; between frames the facade may call pose().
class ObjectStates {
 public:
  ObjectStates(ServerState& state, const ServerExchange& exchange) noexcept : state_(state), exchange_(exchange) {}

  /// At the cut.
  void begin() noexcept { host_owned_moved_ = 0; }

  /// Pose of the live object in that slot after the last frame, wherever it is stored. Between frames.
  const Pose& pose(std::uint32_t slot) const noexcept;
  /// Whether the state of an object is current only in the memory of its host.
  bool is_in_host(std::uint32_t slot) const noexcept {
    return exchange_.reads_nodes() && (state_.objects.marks(slot) & host_owned_mark) != 0;
  }
  /// Calls visit(node, objects, i) for objects of which that is true: object i of the RegionObjects of a node. Between
  /// frames. An object that its host has only just received may be left out.
  template <class Visit>
  void each_in_host(Visit visit) const;
  /// The model's state of the same object.
  const std::byte* state(std::uint32_t slot) const noexcept;
  /// Whether the table needs no states of objects that CD nodes host: the server reads those of the nodes, and no node
  /// can be lost. Then they have no_state_mark.
  bool nodes_keep_states() const noexcept;
  /// At the cut, when all hosts have the objects of the frames before: frees the memory of states that the table does
  /// not need. It looks at all slots.
  void release() noexcept;
  /// At the cut: stores the state of an object in the table, if only its host has it.
  void fetch_state(std::uint32_t slot);
  /// Sets the bounds of an object from its pose in the table.
  void set_bounds(std::uint32_t slot) noexcept;
  /// Between frames: from now on the server sends updates of the object. If its host goes on, the place message clears
  /// the host-owned flag there.
  void end_host_owned(std::uint32_t slot);
  /// Stores the states that a host of the server has just moved, and counts those that it refused.
  void apply_moves(Host& host);

  // While the nodes wait, or are lost.
  /// Stores the host-owned state of an object in `frame`, unless the state was reported or stored since. `node` is the
  /// object's host; otherwise nothing is stored.
  void store(const PeerSession& node, std::uint64_t frame, const messages::ObjectRef& object, const Pose& pose,
             const std::byte* state);
  /// Stores all states of this frame and the bounds of all objects.
  void store_all();
  /// Stores the host-owned states of a lost node. Its thread may still run, but it no longer writes the states of
  /// `frame`.
  void store_kept(const PeerSession& node, std::uint64_t frame);

  /// The bounds of some objects in the table are not those of their poses.
  void note_stale_bounds() noexcept { bounds_are_stale_ = true; }
  bool has_stale_bounds() const noexcept { return bounds_are_stale_; }
  /// Host-owned objects that moved in this frame and that the table does not list as moved; negative for listed objects
  /// that did not move.
  void add_moved(std::int64_t objects) noexcept { host_owned_moved_ += objects; }
  /// Number of objects that moved in this frame.
  std::uint64_t moved() const noexcept {
    return static_cast<std::uint64_t>(static_cast<std::int64_t>(state_.objects.moved().size()) + host_owned_moved_);
  }

 private:
  const Host* owner(std::uint32_t slot) const noexcept;
  const std::byte* state_in_host(std::uint32_t slot) const noexcept;
  ServerState& state_;
  const ServerExchange& exchange_;
  bool bounds_are_stale_ = false;  ///< bounds of present objects that only their hosts know are outdated
  std::int64_t host_owned_moved_ = 0;
};

template <class Visit>
void ObjectStates::each_in_host(Visit visit) const {
  if (!exchange_.reads_nodes()) {
    return;
  }
  for (const PeerSession& node : state_.nodes) {
    if (!node.is_active()) {
      continue;
    }
    const RegionObjects& known = ServerExchange::known_by(node);
    for (std::uint32_t i = 0; i < known.size(); ++i) {
      const std::uint32_t slot = known.slot(i);
      if (slot < state_.objects.slots() && (state_.objects.marks(slot) & host_owned_mark) != 0 &&
          state_.objects.host(slot) == node.self && state_.objects.numbers()[slot] == known.numbers()[i]) {
        visit(node.self.number(), known, i);
      }
    }
  }
}

}  // namespace ringfence::nodes
