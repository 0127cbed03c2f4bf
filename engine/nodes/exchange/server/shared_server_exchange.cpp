#include "nodes/exchange/server/shared_server_exchange.hpp"

#include <algorithm>
#include <utility>

namespace ringfence::nodes {

void SharedServerExchange::begin_queries() {
  const auto queries = state_.setup.order->queries;
  if (queries.empty() && !std::exchange(had_queries_, false)) {
    return;
  }
  had_queries_ = !queries.empty();
  for (const PeerSession& node : state_.nodes) {
    if (node.connected) {
      node.connection.node_contacts->queries.queries = queries;
    }
  }
}

void SharedServerExchange::begin_senses() {
  for (const PeerSession& node : state_.nodes) {
    if (node.connected) {
      node.connection.node_contacts->sensed = state_.setup.publications->sensed;
    }
  }
}

void SharedServerExchange::begin_ghosts(bool exchanged) noexcept {
  ServerExchange::begin_ghosts(exchanged);
  for (const PeerSession& node : state_.nodes) {
    if (exchanged && node.connected) {
      node.connection.node_contacts->ghost_updates.gate.admit();
    }
  }
}

void SharedServerExchange::close_ghost_gates() noexcept {
  for (const PeerSession& node : state_.nodes) {
    if (node.connected) {
      node.connection.node_contacts->ghost_updates.gate.bar();
    }
  }
}

bool SharedServerExchange::is_reading() const noexcept {
  return !state_.report().lost.empty() &&
         std::any_of(state_.nodes.begin(), state_.nodes.end(), [](const PeerSession& node) {
           return node.lost && (node.connection.node_contacts->ghost_updates.gate.is_inside() ||
                                !node.connection.node_contacts->hand_over_gate.close());
         });
}

void SharedServerExchange::receive_contacts(PeerSession& node, Statistics& statistics) {
  NodeContacts& contacts = *node.connection.node_contacts;
  state_.ledger.receive(node.self.number(), contacts);
  statistics.count_shared(Traffic::m3, contacts.keys.size(), sizeof(messages::CollisionRecord));
}

ServerExchange::Exchanged SharedServerExchange::exchanged(const PeerSession& node) const noexcept {
  const NodeContacts& contacts = *node.connection.node_contacts;
  return {contacts.ghost_updates.size(), contacts.taken};
}

}  // namespace ringfence::nodes
