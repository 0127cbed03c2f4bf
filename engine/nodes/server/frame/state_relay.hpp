#pragma once

#include <cstdint>

#include "base/flat_list.hpp"
#include "base/prefetch.hpp"
#include "nodes/exchange/server/server_exchange.hpp"
#include "nodes/server/server_state.hpp"

namespace ringfence::nodes {

/// State relay: what user nodes read of the active and non-active objects. From their point of view the server hosts
/// all of these; others publish most of them: in user deployment the user nodes, in user/collision deployment the CD
/// nodes of this process, each the objects that it hosts. The server publishes the rest, and lists the valid
/// publications.
///
/// Threads: belongs to the server role. Memory: 4 bytes a slot.
class StateRelay {
 public:
  StateRelay(ServerState& state, const ServerExchange& exchange);

  /// At the cut, when the nodes of the frame are known: decides who publishes, and notifies the nodes.
  void begin();
  /// Notifies a node that joins within the frame.
  void order(PeerSession& node) const noexcept;
  /// The object in that slot has this position in this frame. Cheaper here than in publish(), where its row is no
  /// longer in the cache.
  void note_position(std::uint32_t slot, Vec3d position) noexcept {
    if (slot < cells_.size() && cells_[slot] != not_relayed) {
      cells_[slot] = cell_of(position);
      state_.objects.marks(slot) |= cell_noted_mark;
    }
  }
  /// Prefetches what note_position() accesses.
  void prefetch_cell(std::uint32_t slot) const noexcept {
    if (slot < cells_.size()) {
      base::prefetch_for_write(&cells_[slot]);
    }
  }
  /// When all poses are final: publishes what no other role publishes: everything, or the objects of nodes in other
  /// processes and of lost nodes. `holds_lost_objects`: the server holds objects of lost nodes. Repeated in the same
  /// frame after a loss, unless user nodes already read: then the lost node had published before, too, and its
  /// publication holds S(k).
  void publish(bool holds_lost_objects);
  /// Whether every role has published, and user nodes have not been allowed to read.
  bool is_ready() noexcept;
  /// All states are in publications that do not change any more in this frame: lists them, and sends the users
  /// `read_publications`, so that they read while the nodes test. If a ring is full, the message is sent
  /// together with the contacts: the server does not wait here.
  void allow_reading();
  /// Whether user nodes may read. The contacts are not final before that, so no role misses a publication.
  bool allows_reading() const noexcept { return is_final_; }
  /// Continues sending `read_publications`; true when it is sent.
  bool send_read_publications(UserConnection& peers) {
    return state_.send_to_all(peers, peers.read_publications_run, messages::MessageType::read_publications);
  }

 private:
  static constexpr std::uint32_t not_relayed = 0xffffffffu;

  bool is_needed() const noexcept {
    return state_.setup.interest > 0 && !state_.connected.empty() && state_.setup.deployment != Deployment::user;
  }
  std::uint32_t cell_of(const Vec3d& position) const noexcept { return state_.setup.publications->cell_of(position); }
  void update_cells();
  void list_publications();
  void count(const Published& relay) noexcept;

  ServerState& state_;
  const ServerExchange& exchange_;
  base::FlatList<std::uint32_t> cells_;  ///< by slot: cell in the server's publication, or not_relayed
  bool nodes_publish_ = false;           ///< CD nodes publish what they host in this frame
  bool cells_are_known_ = false;         ///< cells_ are valid except for objects that moved in this frame
  bool is_final_ = false;                ///< user nodes may read: the publications of this frame no longer change
};

}  // namespace ringfence::nodes
