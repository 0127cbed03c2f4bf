#include "nodes/server/shared_nodes.hpp"

#include <algorithm>

namespace ringfence::nodes {

bool SharedNodes::can_exchange_objects() const noexcept {
  const ServerSetup& setup = state_.setup;
  return setup.placement == Placement::region && setup.deployment == Deployment::user_collision &&
         std::all_of(state_.nodes.begin(), state_.nodes.end(), [&](const PeerSession& node) {
           return !node.connected || (is_shared(node) && (setup.interest <= 0 || can_publish(node)));
         });
}

void SharedNodes::begin_ghosts(bool exchanged) noexcept {
  ghosts_exchanged_ = exchanged;
  for (const PeerSession& node : state_.nodes) {
    if (exchanged && is_shared(node)) {
      node.connection.node_contacts->ghost_updates.gate.admit();
    }
  }
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

void SharedNodes::set_exchange(PeerSession& node, bool contacts, bool objects) noexcept {
  if (is_shared(node)) {
    node.connection.node_contacts->nodes_exchange_contacts = contacts;
    node.connection.node_contacts->hosts_exchange_objects = objects;
  }
}

void SharedNodes::count_reads(Statistics& statistics) const noexcept {
  if (state_.setup.deployment != Deployment::user_collision) {
    return;
  }
  for (const PeerSession& node : state_.nodes) {
    if (is_shared(node) && !node.lost) {
      const NodeContacts& contacts = *node.connection.node_contacts;
      statistics.count_shared(Traffic::m2, ghosts_exchanged_ ? contacts.ghost_updates.size() : 0,
                              sizeof(messages::PositionRecord));
      statistics.count_shared(Traffic::m4, contacts.taken, sizeof(Contact));
    }
  }
}

void SharedNodes::order_publication(PeerSession& node, bool wanted) noexcept {
  if (can_publish(node)) {
    node.connection.publication->wanted = wanted;
  }
}

}  // namespace ringfence::nodes
