#pragma once

#include <cstdint>

#include "base/flat_list.hpp"
#include "nodes/exchange/server/server_exchange.hpp"
#include "nodes/server/server_state.hpp"

namespace ringfence::nodes {

/// State relay: what user nodes read of the active and non-active objects. From their point of view the server hosts
/// all of these; others publish most of them: in user deployment the user nodes, in user/collision deployment the CD
/// nodes of this process, each the objects that it hosts. The server publishes the rest, and lists the valid
/// publications.
///
/// Threads: belongs to the server role. Memory: 1 byte a slot.
class StateRelay {
 public:
  StateRelay(ServerState& state, const ServerExchange& exchange);

  /// At the cut, when the nodes of the frame are known: decides who publishes, and notifies the nodes.
  void begin();
  /// Notifies a node that joins within the frame.
  void order(PeerSession& node) const noexcept;
  /// When all poses are final: publishes what no other role publishes: everything, or the objects of nodes in other
  /// processes and of lost nodes. `holds_lost_objects`: the server holds objects of lost nodes. Repeated in the same
  /// frame after a loss, unless user nodes already read: then the lost node had published before, too, and its
  /// publication holds S(k).
  void publish(bool holds_lost_objects);
  /// Whether every role has published, and user nodes have not been allowed to read. `nodes_have_published`: whether
  /// all nodes have; asked if they publish.
  template <class Have>
  bool is_ready(Have nodes_have_published) {
    return !is_final_ && state_.users_have_published() && (!nodes_publish_ || nodes_have_published());
  }
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
  bool is_needed() const noexcept {
    return state_.setup.interest > 0 && !state_.connected.empty() && state_.setup.deployment != Deployment::user;
  }
  bool is_relayed(std::uint32_t slot) const noexcept {
    const auto category = static_cast<Category>(state_.objects.row(slot).category);
    return state_.objects.present()[slot] != 0 && (category == Category::active || category == Category::non_active);
  }
  void list_objects();
  void list_publications();
  void count(const Published& relay) noexcept;

  ServerState& state_;
  const ServerExchange& exchange_;
  base::FlatList<std::uint8_t> listed_;  ///< by slot, 1: it is an entry of the server's publication
  bool nodes_publish_ = false;           ///< CD nodes publish what they host in this frame
  bool list_is_known_ = false;           ///< all objects are listed but those that are new or moved in this frame
  bool is_final_ = false;                ///< user nodes may read: the publications of this frame no longer change
};

}  // namespace ringfence::nodes
