#include "nodes/server/shared_nodes.hpp"

#include <algorithm>
#include <cstring>

namespace ringfence::nodes {

bool SharedNodes::can_exchange_objects() const noexcept {
  return state_.hosts_send_ghosts() &&
         std::all_of(state_.nodes.begin(), state_.nodes.end(), [&](const PeerSession& node) {
           return !node.connected || !is_shared(node) || state_.setup.interest <= 0 || can_publish(node);
         });
}

void SharedNodes::begin_ghosts(bool exchanged) noexcept {
  ghosts_exchanged_ = exchanged;
  for (PeerSession& node : state_.nodes) {
    if (exchanged && is_shared(node)) {
      node.connection.node_contacts->ghost_updates.gate.admit();
    } else if (!is_shared(node) && state_.hosts_send_ghosts()) {
      node.closing.ghosts_run.start(1);
    }
  }
}

bool SharedNodes::send_ghosts(PeerSession& node) {
  return node.closing.ghosts_run.pump(
      *node.connection.out, state_.head(messages::MessageType::ghosts_sent, node.self),
      sizeof(messages::GhostsSentRecord), state_.report().traffic, [&](std::size_t, std::byte* where) {
        const messages::GhostsSentRecord record{ghosts_exchanged_ ? state_.direct_ghosts.to(node.self.number()) : 0};
        std::memcpy(where, &record, sizeof record);
      });
}

void SharedNodes::close_ghost_gates() noexcept {
  for (const PeerSession& node : state_.nodes) {
    if (is_shared(node)) {
      node.connection.node_contacts->ghost_updates.gate.bar();
    }
  }
}

bool SharedNodes::is_reading_ghosts() const noexcept {
  return std::any_of(state_.nodes.begin(), state_.nodes.end(), [](const PeerSession& node) {
    return node.lost && is_shared(node) && node.connection.node_contacts->ghost_updates.gate.is_inside();
  });
}

bool SharedNodes::receive_contacts(PeerSession& node, Statistics& statistics) {
  NodeContacts* const contacts = node.connection.node_contacts;
  if (contacts == nullptr) {
    return false;
  }
  state_.ledger.receive(node.self.number(), *contacts);
  statistics.count_shared(Traffic::m3, contacts->keys.size(), sizeof(messages::CollisionRecord));
  return true;
}

void SharedNodes::count_reads(Statistics& statistics) const noexcept {
  if (state_.setup.deployment != Deployment::user_collision) {
    return;
  }
  for (const PeerSession& node : state_.nodes) {
    if (!node.is_active()) {
      continue;
    }
    const NodeContacts* const contacts = node.connection.node_contacts;
    const NodeNumber slot = node.self.number();
    const std::uint64_t ghosts = contacts != nullptr ? contacts->ghost_updates.size() : state_.direct_ghosts.to(slot);
    state_.report().ghost_updates += ghosts_exchanged_ ? ghosts : 0;
    statistics.count_shared(Traffic::m2, ghosts_exchanged_ ? ghosts : 0, sizeof(messages::PositionRecord));
    statistics.count_shared(Traffic::m4, contacts != nullptr ? contacts->taken : state_.direct_contacts.to(slot),
                            sizeof(Contact));
  }
}

void SharedNodes::order_publication(PeerSession& node, bool wanted) noexcept {
  if (can_publish(node)) {
    node.connection.publication->wanted = wanted;
  }
}

}  // namespace ringfence::nodes
