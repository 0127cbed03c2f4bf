#pragma once

#include <span>
#include <vector>

#include "nodes/exchange/server/direct_records.hpp"
#include "nodes/exchange/server/sensed_regions.hpp"
#include "nodes/exchange/server/server_exchange.hpp"

namespace ringfence::nodes {

/// ServerExchange of a world with node processes. The nodes send their contacts to the server, and ghost updates and
/// contacts directly to each other; the server announces the numbers of these to the receivers. It sends the nodes the
/// queries of the frame, and receives the hits; and it sends them the objects that their models may sense.
class MessageServerExchange final : public ServerExchange {
 public:
  explicit MessageServerExchange(ServerState& state) : ServerExchange(state, false) { MessageServerExchange::begin(); }

  bool send_map(PeerSession& node, messages::RunSender& run) override;
  void start_end(PeerSession& node, bool) override { node.end_run.start(1); }
  void announce(AnnouncedStep step, PeerSession::Reached PeerSession::*reached) override;
  void begin() override;
  void begin_queries() override;
  void begin_senses() override;
  bool send_queries(PeerSession& node) override;
  bool send_sensed(PeerSession& node) override;
  bool receive_hits(const PeerSession& node, const messages::MessageView& message) override;
  const NodeQueries& queries_of(const PeerSession& node) const noexcept override {
    return answers_[node.self.number()];
  }
  bool receive_counts(const PeerSession& node, const messages::MessageView& message) override;
  void begin_ghosts(bool exchanged) noexcept override;
  bool send_ghosts(PeerSession& node) override;
  void receive_contacts(PeerSession& node, Statistics&) override {
    state_.ledger.end_run(node.self.number(), state_.objects.contact_objects());
  }
  void retract_contacts(const PeerSession& node, std::span<const UnlistedContact> unlisted) override;
  std::uint64_t announced_contacts(const PeerSession& node) const noexcept override {
    return contacts_.to(node.self.number());
  }
  void cancel_contacts(NodeNumber node) override;
  void count_records(Statistics& statistics) const noexcept override;

 private:
  NodeNumber next_host(std::uint32_t slot, NodeNumber finder) const noexcept;

  DirectRecords ghosts_, contacts_;   ///< of this frame
  std::vector<NodeQueries> answers_;  ///< by slot
  SensedRegions sensed_;
};

}  // namespace ringfence::nodes
