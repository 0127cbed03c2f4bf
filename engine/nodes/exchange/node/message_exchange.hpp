#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <vector>

#include "base/flat_list.hpp"
#include "messages/records.hpp"
#include "messages/run.hpp"
#include "nodes/exchange/node/node_exchange.hpp"
#include "queries/recorded_frame.hpp"

namespace ringfence::nodes {

/// NodeExchange of a node in a world with node processes. Everything is a message, directly to the node or the server
/// that needs it.
///
/// Host-owned states go to the server as `replica`. Ghost updates (`ghost`) and contacts (`notify`) go to the other
/// nodes, as do hand-overs (`hand_over`); their numbers go to the server (`ghost_counts`, `contact_counts`), which
/// announces them to the receivers. The server receives the contacts (`collision`) and those that began or ended
/// (`change`), and writes the output lists. It sends the queries of a frame (`query`), receives their answers
/// (`query_hit`), and sends what models may ask about
/// (`sensed`).
class MessageExchange final : public NodeExchange {
 public:
  explicit MessageExchange(NodeState& state) : NodeExchange(state) {}

  void assign() override { peers_.resize(state_.setup.peers.size()); }
  bool trusts_senders() const noexcept override { return false; }
  void flush() override;
  void receive_queries(const messages::MessageView& message) override;
  void receive_sensed(const messages::MessageView& message) override;
  bool takes_sensed(std::size_t objects) const noexcept override {
    return (has_all_sensed_ ? 0 : sensed_.size()) + objects <= state_.setup.max_slots;
  }
  bool may_begin() const noexcept override { return has_all_queries_ && has_all_sensed_; }
  bool send_hits() override;
  void begin() override;
  bool report_batch() override;
  bool finish_report() override;
  bool send_ghosts() override;
  bool receive_ghosts(HaloExchange&) override {
    return !state_.keeps_host_owned() || ghosts_arrived_ >= ghosts_expected_;
  }
  void discard_ghosts() noexcept override;
  void begin_contacts() override;
  void list_kinds(std::span<const messages::KindRecord> kinds) noexcept override { kinds_ = kinds; }
  bool send_contacts(const messages::NarrowDoneRecord& totals) override;
  void share_contacts() override;
  bool send_to_peers() override;
  void expect_contacts(std::uint64_t contacts) noexcept override { contacts_expected_ = contacts; }
  void receive_contacts(const messages::MessageView& message) override;
  void start_hand_overs(const PeerLists& leaving) override;
  bool send_hand_overs() override;
  void lose(const messages::LostRecord& record) noexcept override;
  bool complete_contacts() override;
  bool report_done(const messages::NodeFrameStats& stats) override;

 private:
  /// What is sent to another node, and received from it.
  struct Peer {
    base::FlatList<GhostUpdates::Update> ghosts;
    messages::RunSender ghosts_run, contacts_run, hand_overs_run;
    std::uint64_t contacts_arrived = 0;
    bool lost = false;  ///< since the contacts are listed
  };

  std::size_t replica_bytes() const noexcept { return sizeof(messages::ReplicaRecord) + state_.host.state_bytes(); }
  bool send_replicas();
  void flush_replicas();
  void list_ghosts();
  bool send_collisions();
  messages::ChangeRecord change(std::size_t i) const noexcept;

  std::vector<messages::QueryRecord> queries_;  ///< as received
  std::uint64_t queries_frame_ = NodeQueries::no_frame;
  bool has_all_queries_ = true;
  std::vector<messages::SensedRecord> sensed_;  ///< as received
  std::vector<std::uint32_t> sensed_slots_;     ///< 0, 1, 2, ...
  std::uint64_t sensed_frame_ = NodeQueries::no_frame;
  bool has_all_sensed_ = true;
  std::unique_ptr<queries::RecordedFrame> frame_before_;  ///< made of sensed_; null if nothing was sensed so far
  messages::RunSender hits_run_;
  bool hits_started_ = false;  ///< in this frame
  bool done_started_ = false;  ///< the same: report_done() was called
  std::vector<Peer> peers_;    ///< by slot
  messages::RunWriter replicas_run_, collisions_run_;
  std::size_t next_owned_ = 0, next_contact_ = 0;  ///< next to send
  std::vector<messages::CountRecord> ghost_counts_, contact_counts_;
  messages::RunSender ghost_counts_run_, contact_counts_run_, change_run_, narrow_done_run_, kinds_run_, done_run_;
  std::span<const messages::KindRecord> kinds_;  ///< of this frame
  bool ghosts_listed_ = false;                   ///< in this frame
  const PeerLists* leaving_ = nullptr;           ///< objects that are handed over, by number
  std::vector<Contact> received_;                ///< from other nodes, in the order of arrival
  std::uint64_t contacts_expected_ = 0;
  std::uint64_t contacts_arrived_ = 0;  ///< without those of nodes that were lost
};

}  // namespace ringfence::nodes
