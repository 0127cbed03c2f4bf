#pragma once

#include <cstdint>
#include <vector>

#include "nodes/exchange/server/server_exchange.hpp"
#include "nodes/server/frame/state_relay.hpp"
#include "nodes/server/frame/statistics.hpp"
#include "nodes/server/objects/object_states.hpp"
#include "nodes/server/server_state.hpp"

namespace ringfence::nodes {

/// Loss of CD nodes.
///
/// The server has C(k-1) and S(k-1) of every object: in its table, or in memory that it shares with the host. Each S(k)
/// that was reported is final. So the loss of a node before the contacts are known costs only time: the other nodes get
/// its cells, the server moves those of its objects that were not reported, and the frame is detected again under a new
/// map. The new epoch invalidates the results found under the old map.
///
/// If a node is lost after the contacts are known, only its objects have to be recovered: the server becomes the host
/// of all objects that the node hosts, hands over or receives. At the next cut the slots of lost nodes become free, and
/// the server gives every recovered object, with its contacts, to the node whose region contains it.
///
/// If the last node is lost before the contacts are known, the facade creates a fallback node (FrameOrder).
///
/// Threads: belongs to the server role.
class Failover {
 public:
  Failover(ServerState& state, ServerExchange& exchange, ObjectStates& states, StateRelay& relay,
           Statistics& statistics);

  /// The node in the slot is lost. Does nothing if the slot is free or its node already lost. Precondition: a frame is
  /// running. May return the frame to FrameStage::moving, with a new map.
  void lose(NodeNumber node);
  /// Loses the nodes that have broken the protocol (PeerSession::broken). Not while messages are read: the stage, the
  /// map and the lists over which the readers iterate change.
  void lose_broken_nodes();
  /// Whether a loss has not been announced to all nodes. Then the frame does not advance: see send().
  bool is_pending() const noexcept { return pending_; }
  /// Announces losses and the new map to the nodes, and connects the fallback node. Returns true when all is sent.
  bool send();
  /// Whether the server holds objects of lost nodes until the next cut.
  bool holds_objects() const noexcept { return recovered_; }

  // At the cut.
  void begin() noexcept { pending_ = false; }
  /// A node was lost in the frame before: what lost nodes owned goes to the others.
  void replace_lost_nodes();
  /// Gives every object that the server holds for a lost node to the node whose region contains it.
  void rehost_recovered();

 private:
  static constexpr NodeNumber no_node = 0xffffffffu;

  void announce(NodeNumber node, bool detect_again);
  void reassign_cells();
  void reclaim(std::uint32_t slot);
  void recover_objects(NodeNumber node);
  void detect_again();
  void cancel_hand_overs(NodeNumber node);
  void request_fallback();
  bool connect_fallback();
  bool send(PeerSession& session);

  ServerState& state_;
  ServerExchange& exchange_;
  ObjectStates& states_;
  StateRelay& relay_;
  Statistics& statistics_;
  Host recovery_host_;                  ///< moves objects that lost nodes had not reported
  std::vector<std::uint32_t> table_;    ///< of the map under construction
  std::vector<NodeNumber> remaining_;   ///< the nodes that own the cells of that map
  NodeNumber fallback_slot_ = no_node;  ///< waiting for a fallback node in this slot
  bool pending_ = false;
  bool recovered_ = false;
};

}  // namespace ringfence::nodes
