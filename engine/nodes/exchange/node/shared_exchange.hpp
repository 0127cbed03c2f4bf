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
/// Only receive_ghosts() and share_contacts() read memory of other nodes.
class SharedExchange final : public NodeExchange {
 public:
  explicit SharedExchange(NodeState& state);

  bool trusts_senders() const noexcept override { return true; }
  void begin() override;
  bool report_batch() override;
  bool finish_report() override;
  bool receive_ghosts(HaloExchange& halo) override;
  void share_contacts() override;

 private:
  void read_peer_contacts();

  const bool keeps_states_;                      ///< in HostOwnedStates
  base::FlatList<GhostUpdates::Update> ghosts_;  ///< of the other nodes
  OutputMergeScratch scratch_;
};

}  // namespace ringfence::nodes
