#pragma once

#include <cstdint>

#include "nodes/exchange/publications.hpp"
#include "nodes/server/server_state.hpp"
#include "nodes/server/statistics.hpp"

namespace ringfence::nodes {

/// The memory that CD nodes of the server's process share with the server: their contacts, the objects that they host,
/// their ghost updates and their publications. A node of another process shares nothing.
///
/// All parts of the server access this memory here; only ContactLedger keeps addresses of node contacts. Threads:
/// belongs to the server role; when the server may access which memory, NodeContacts and NodePublication say.
class SharedNodes {
 public:
  explicit SharedNodes(ServerState& state) noexcept : state_(state) {}

  /// Whether the node runs in this process.
  static bool is_shared(const PeerSession& node) noexcept { return node.connection.node_contacts != nullptr; }

  /// The objects that the node hosts; null for a node of another process. The server reads them between frames and
  /// while the node waits.
  static const Host* host_of(const PeerSession& node) noexcept {
    return is_shared(node) ? node.connection.node_contacts->host : nullptr;
  }
  /// The host-owned states that the node keeps for recovery; null for a node of another process.
  static const HostOwnedStates* kept_states(const PeerSession& node) noexcept {
    return is_shared(node) ? &node.connection.node_contacts->host_states : nullptr;
  }
  /// Whether, under a new map, every node can send the others what it hosts, including resting objects, instead of the
  /// server.
  bool can_exchange_objects() const noexcept;

  /// Before the last position of the frame is sent: nodes that have received it exchange ghost updates, or not.
  void begin_ghosts(bool exchanged) noexcept;
  /// Announces to a node of another process how many ghost updates it gets. Returns true when that is sent, or not
  /// needed.
  bool send_ghosts(PeerSession& node);
  /// A node is lost: ghost updates are no longer read in this frame, by no node, because all objects are sent again.
  void close_ghost_gates() noexcept;
  /// Whether a lost node still reads ghost updates. Then no other node may begin the next frame.
  bool is_reading_ghosts() const noexcept;

  /// After `narrow_done` of a node: passes its shared contacts to the ledger. Returns false if it has sent them
  /// instead.
  bool receive_contacts(PeerSession& node, Statistics& statistics);
  /// At the end of the frame: counts what nodes have sent each other, or read from each other in shared memory.
  void count_reads(Statistics& statistics) const noexcept;

  /// Before the node's frame begins: whether its publication is read in this frame.
  static void order_publication(PeerSession& node, bool wanted) noexcept;
  /// Whether the node can publish the objects that it hosts.
  static bool can_publish(const PeerSession& node) noexcept { return node.connection.publication != nullptr; }
  /// Precondition: can_publish().
  static const Published& published(const PeerSession& node) noexcept { return node.connection.publication->published; }

 private:
  ServerState& state_;
  bool ghosts_exchanged_ = false;  ///< in this frame
};

}  // namespace ringfence::nodes
