#pragma once

#include "nodes/exchange/server/direct_records.hpp"
#include "nodes/exchange/server/server_exchange.hpp"

namespace ringfence::nodes {

/// ServerExchange of a world with node processes. The nodes send their contacts to the server, and ghost updates and
/// contacts directly to each other; the server announces the numbers of these to the receivers.
class MessageServerExchange final : public ServerExchange {
 public:
  explicit MessageServerExchange(ServerState& state) : ServerExchange(state, false) { MessageServerExchange::begin(); }

  void begin() override;
  void begin_queries() override {}
  const NodeQueries& queries_of(const PeerSession&) const noexcept override { return no_queries_; }
  bool receive_counts(const PeerSession& node, const messages::MessageView& message) override;
  void begin_ghosts(bool exchanged) noexcept override;
  bool send_ghosts(PeerSession& node) override;
  void receive_contacts(PeerSession& node, Statistics&) override {
    state_.ledger.end_run(node.self.number(), state_.objects.contact_objects());
  }
  std::uint64_t announced_contacts(const PeerSession& node) const noexcept override {
    return contacts_.to(node.self.number());
  }
  void cancel_contacts(NodeNumber node) override;

 private:
  Exchanged exchanged(const PeerSession& node) const noexcept override {
    return {ghosts_.to(node.self.number()), contacts_.to(node.self.number())};
  }

  DirectRecords ghosts_, contacts_;  ///< of this frame
  NodeQueries no_queries_;           ///< node processes do not answer queries
};

}  // namespace ringfence::nodes
