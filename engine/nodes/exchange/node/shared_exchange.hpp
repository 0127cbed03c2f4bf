#pragma once

#include "base/flat_list.hpp"
#include "nodes/exchange/node/node_exchange.hpp"
#include "nodes/exchange/output_merge.hpp"

namespace ringfence::nodes {

/// NodeExchange of a node that shares memory with the server and all other nodes: each reads the others' arrays
/// (NodeContacts) in place, behind a gate.
///
/// The server receives an object's state only when it appears, comes to rest or changes its host. Host-owned states
/// stay here; if the node may be lost, they are copied to HostOwnedStates, which outlives it. Each node writes a slice
/// of the output lists.
///
/// Only receive_ghosts(), share_contacts() and receive_hand_overs() read memory of other nodes.
class SharedExchange final : public NodeExchange {
 public:
  explicit SharedExchange(NodeState& state);

  bool trusts_senders() const noexcept override { return true; }
  void begin() override;
  bool report_batch() override;
  bool finish_report() override;
  bool receive_ghosts(HaloExchange& halo) override;
  void begin_contacts() override;
  void share_contacts() override;
  void list_hand_overs(const PeerLists& leaving) override;
  bool lists_hand_overs() const noexcept override { return true; }
  void start_hand_overs(const PeerLists& leaving) override;
  void receive_hand_overs(Migration& migration) override;

 private:
  void read_peer_contacts();
  void add_to_senders(SenderSet NodeContacts::*senders, NodeNumber receiver) const noexcept;

  const bool keeps_states_;                      ///< in HostOwnedStates
  base::FlatList<GhostUpdates::Update> ghosts_;  ///< of the other nodes
  OutputMergeScratch scratch_;
  base::FlatList<NodeNumber> senders_;  ///< of contacts; scratch
};

}  // namespace ringfence::nodes
