#pragma once

#include <cstddef>
#include <cstdint>
#include <span>

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
  /// Whether CD nodes of this process have the states of all objects that they host.
  bool reads_hosts() const noexcept { return exchange_.reads_nodes() && state_.hosts_send_ghosts(); }
  /// If reads_hosts(): calls visit(objects, first, count) for the present objects that CD nodes host and know: objects
  /// `first` to `first + count - 1` of a node's RegionObjects, which has their states also if the table has them too.
  /// Between frames. Objects are left out if their host has only just received them, or if their bounds are outside its
  /// region.
  template <class Visit>
  void each_in_node(Visit visit) const;
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
  /// The same for at most Host::batch objects of the host, by their indices there.
  void apply_batch(Host& host, std::span<const std::uint32_t> changed);
  const Host* owner(std::uint32_t slot) const noexcept;
  const std::byte* state_in_host(std::uint32_t slot) const noexcept;
  ServerState& state_;
  const ServerExchange& exchange_;
  bool bounds_are_stale_ = false;  ///< bounds of present objects that only their hosts know are outdated
  std::int64_t host_owned_moved_ = 0;
};

template <class Visit>
void ObjectStates::each_in_node(Visit visit) const {
  if (!reads_hosts()) {
    return;
  }
  const std::span<const messages::Endpoint> hosts = state_.objects.hosts();
  const std::span<const ObjectNumber> numbers = state_.objects.numbers();
  const std::span<const std::uint8_t> present = state_.objects.present();
  for (const PeerSession& node : state_.nodes) {
    if (!node.is_active()) {
      continue;
    }
    const RegionObjects& known = ServerExchange::known_by(node);
    const std::span<const std::uint32_t> known_slots = known.slots();
    const std::span<const ObjectNumber> known_numbers = known.numbers();
    const auto is_hosted = [&](std::size_t i) {
      const std::uint32_t slot = known_slots[i];
      return slot < hosts.size() && hosts[slot] == node.self && numbers[slot] == known_numbers[i] && present[slot] != 0;
    };
    for (std::size_t end = 0; end < known_slots.size();) {
      std::size_t first = end;
      while (first < known_slots.size() && !is_hosted(first)) ++first;
      for (end = first; end < known_slots.size() && is_hosted(end);) ++end;
      if (first != end) visit(known, first, end - first);
    }
  }
}

}  // namespace ringfence::nodes
