#include "nodes/exchange/server/shared_server_exchange.hpp"

#include <algorithm>
#include <bit>
#include <iterator>
#include <utility>

#include "base/prefetch.hpp"
#include "telemetry/clock.hpp"

namespace ringfence::nodes {

// The message has the address of the map, which the node copies. It counts as if it had the entries.
bool SharedServerExchange::send_map(PeerSession& node, messages::RunSender& run) {
  if (run.done()) {
    return true;
  }
  if (sent_maps_.empty() || sent_maps_.back()->epoch() != state_.map.epoch()) {
    sent_maps_.push_back(std::make_unique<const regions::RegionMap>(state_.map));
  }
  const regions::RegionMap* const map = sent_maps_.back().get();
  run.start(1);
  if (!state_.send(node, run, messages::MessageType::region_map,
                   [&](std::size_t) { return std::bit_cast<messages::OwnerRecord>(map); })) {
    return false;
  }
  const std::size_t entries = map->table().size(), bytes = entries * sizeof(messages::OwnerRecord);
  const std::size_t more_messages = bytes / (node.connection.out->largest_message() - sizeof(messages::Header));
  TrafficReport& traffic = state_.report().traffic[static_cast<std::size_t>(Traffic::control)];
  traffic.messages += more_messages;
  traffic.records += entries - 1;
  traffic.bytes += bytes - sizeof(messages::OwnerRecord) + more_messages * sizeof(messages::Header);
  return true;
}

// Every node that is not lost has read what was sent to it in the frame.
void SharedServerExchange::finish() {
  if (!state_.report().lost.empty()) {
    std::move(sent_maps_.begin(), sent_maps_.end(), std::back_inserter(abandoned_maps_));
  }
  sent_maps_.clear();
}

void SharedServerExchange::start_end(PeerSession& node, bool hosts_exchange_objects) {
  const bool has_content = hosts_exchange_objects || node.hand_overs != 0;
  node.connection.node_contacts->end = {node.hand_overs, 0, hosts_exchange_objects ? 1u : 0u, 0};
  node.end_run.stop();
  messages::count_message(state_.report().traffic, state_.head(messages::MessageType::frame_end, node.self),
                          has_content ? sizeof(messages::FrameEndRecord) : 0, has_content ? 1 : 0);
}

void SharedServerExchange::expect_nodes() {
  state_.list_shared_nodes();
  FrameControl::Members members{};
  for (std::size_t slot = 0; slot < state_.shared_nodes.size(); ++slot) {
    if (state_.shared_nodes[slot] != nullptr) {
      members[slot / 64] |= std::uint64_t{1} << slot % 64;
    }
  }
  state_.setup.frame_control->expect(members, state_.wake_tree == nullptr);
}

void SharedServerExchange::announce(AnnouncedStep step, PeerSession::Reached PeerSession::*reached) {
  if (!state_.setup.frame_control->announce(state_.frame, state_.map.epoch(), step)) {
    return;
  }
  if (state_.wakes_together()) {
    state_.wake_nodes();
    return;
  }
  for (PeerSession& node : state_.nodes) {
    if (!node.is_active()) {
      continue;
    }
    if (link::Doorbell* const bell = node.connection.node_contacts->bell) {
      bell->ring();
    }
    if (reached != nullptr) {
      (node.*reached).ns = telemetry::now_ns();
    }
  }
}

void SharedServerExchange::dismiss(PeerSession& node) noexcept {
  // The next announcement is a release store, so a node that sees it sees this too.
  node.connection.node_contacts->report.dismissed.store(true, std::memory_order_relaxed);
  if (node.self.number() < state_.shared_nodes.size()) {
    state_.shared_nodes[node.self.number()] = nullptr;
  }
  state_.setup.frame_control->wake_for_each();
}

void SharedServerExchange::admit(PeerSession& node) noexcept {
  node.connection.node_contacts->report.dismissed.store(false, std::memory_order_relaxed);
  state_.shared_nodes[node.self.number()] = node.connection.node_contacts;
}

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
  if (exchanged) {
    state_.each_shared_node([](NodeContacts& node) { base::prefetch_for_write(&node.ghost_updates.gate); },
                            [](NodeNumber, NodeContacts& node) { node.ghost_updates.gate.admit(); });
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

void SharedServerExchange::list_next_hosts(base::FlatList<NextHostOf>& next_hosts) {
  if (state_.setup.nodes_may_be_lost || !state_.hosts_send_ghosts()) {
    return;  // the nodes list none
  }
  lists_.clear();
  state_.each_shared_node([](const NodeContacts& node) { base::prefetch_for_read(&node.report); },
                          [this](NodeNumber, const NodeContacts& node) {
                            lists_.push_back(node.report.next_hosts);
                            base::prefetch_for_read(node.report.next_hosts.data());
                          });
  for (const std::span<const NextHostOf> list : lists_) {
    for (const NextHostOf& object : list) {
      next_hosts.push_back(object);
    }
  }
}

void SharedServerExchange::receive_contacts(PeerSession& node, Statistics& statistics) {
  NodeContacts& contacts = *node.connection.node_contacts;
  state_.ledger.receive(node.self.number(), contacts);
  statistics.count_shared(Traffic::m3, contacts.summary.contacts, sizeof(messages::CollisionRecord));
}

void SharedServerExchange::count_records(Statistics& statistics) const noexcept {
  if (!state_.nodes_host()) {
    return;
  }
  state_.each_shared_node([](const NodeContacts& node) { base::prefetch_for_read(&node.report.ghosts); },
                          [&](NodeNumber, const NodeContacts& node) {
                            count(statistics, {node.report.ghosts, node.report.taken});
                          });
}

}  // namespace ringfence::nodes
