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
/// of the output lists. Words of FrameControl and StepReport control the frame. Messages have records, so their last
/// one is not marked: a word says that no more follow.
///
/// Only receive_ghosts(), share_contacts() and receive_hand_overs() read memory of other nodes.
class SharedExchange final : public NodeExchange {
 public:
  explicit SharedExchange(NodeState& state);

  bool trusts_senders() const noexcept override { return true; }
  void assign() override;
  void finish_step() override;
  FrameControl::Announced announced() const noexcept override;
  std::uint64_t announced_frame() const noexcept override { return frame_control_.frame(); }
  void begin() override;
  bool report_batch() override;
  bool finish_report() override;
  void report_published() noexcept override { reach(ReportedStep::published); }
  bool receive_ghosts(HaloExchange& halo) override;
  void begin_contacts() override;
  void list_kinds(std::span<const messages::KindRecord> kinds) noexcept override {
    state_.contacts.report.kinds = kinds;
  }
  bool send_contacts(const messages::NarrowDoneRecord& totals) override;
  void share_contacts() override;
  void list_hand_overs(const PeerLists& leaving) override;
  bool lists_hand_overs() const noexcept override { return true; }
  void start_hand_overs(const PeerLists& leaving) override;
  void receive_hand_overs(Migration& migration) override;
  bool report_done(const messages::NodeFrameStats& stats) override;

 private:
  void reach(ReportedStep step) noexcept;
  bool note_messages() noexcept;
  void read_peer_contacts();
  void add_to_senders(SenderSet NodeContacts::*senders, NodeNumber receiver) const noexcept;

  FrameControl& frame_control_;
  const bool keeps_states_;                      ///< in HostOwnedStates
  base::FlatList<GhostUpdates::Update> ghosts_;  ///< of the other nodes
  OutputMergeScratch scratch_;
  base::FlatList<NodeNumber> senders_;  ///< of contacts; scratch
};

}  // namespace ringfence::nodes
