#include "nodes/exchange/server/message_server_exchange.hpp"

namespace ringfence::nodes {

using messages::MessageType;

void MessageServerExchange::begin() {
  ghosts_.start(state_.nodes.size());
  contacts_.start(state_.nodes.size());
}

bool MessageServerExchange::receive_counts(const PeerSession& node, const messages::MessageView& message) {
  return (message.type() == MessageType::ghost_counts ? ghosts_ : contacts_).add(node.self.number(), message);
}

void MessageServerExchange::begin_ghosts(bool exchanged) noexcept {
  ServerExchange::begin_ghosts(exchanged);
  for (PeerSession& node : state_.nodes) {
    if (state_.hosts_send_ghosts()) {
      node.closing.ghosts_run.start(1);
    }
  }
}

bool MessageServerExchange::send_ghosts(PeerSession& node) {
  return state_.send(node, node.closing.ghosts_run, MessageType::ghosts_sent, [&](std::size_t) {
    return messages::GhostsSentRecord{ghosts_exchanged_ ? ghosts_.to(node.self.number()) : 0};
  });
}

void MessageServerExchange::cancel_contacts(NodeNumber node) {
  state_.all_nodes([&](PeerSession& other) {
    if (other.closing.end_run.done()) {
      other.loss.records.back().contacts = contacts_.between(node, other.self.number());
    }
    return true;
  });
  contacts_.remove(node);
  state_.lost_finders.push_back(node);
}

}  // namespace ringfence::nodes
