#pragma once

#include "nodes/exchange/server/server_exchange.hpp"

namespace ringfence::nodes {

/// ServerExchange of a world whose nodes share memory with the server: their contacts, the objects that they host,
/// their ghost updates and their publications. NodeContacts and HostPublication say who may access what when.
///
/// Only this class and ContactLedger open and close gates.
class SharedServerExchange final : public ServerExchange {
 public:
  explicit SharedServerExchange(ServerState& state) noexcept : ServerExchange(state, true) {}

  void begin_queries() override;
  void begin_senses() override;
  const NodeQueries& queries_of(const PeerSession& node) const noexcept override {
    return node.connection.node_contacts->queries;
  }
  void begin_ghosts(bool exchanged) noexcept override;
  void close_ghost_gates() noexcept override;
  bool is_reading() const noexcept override;
  void receive_contacts(PeerSession& node, Statistics& statistics) override;

 private:
  Exchanged exchanged(const PeerSession& node) const noexcept override;

  bool had_queries_ = false;  ///< in the last frame
};

}  // namespace ringfence::nodes
