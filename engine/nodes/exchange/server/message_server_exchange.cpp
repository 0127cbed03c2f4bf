#include "nodes/exchange/server/message_server_exchange.hpp"

#include <algorithm>

namespace ringfence::nodes {

using messages::Endpoint;
using messages::MessageType;

bool MessageServerExchange::send_map(PeerSession& node, messages::RunSender& run) {
  return state_.send(node, run, MessageType::region_map,
                     [this](std::size_t i) { return messages::OwnerRecord{state_.map.table()[i]}; });
}

// The messages themselves say it; where they wake no node, the nodes are woken together.
void MessageServerExchange::announce(AnnouncedStep, PeerSession::Reached PeerSession::*) {
  if (state_.wakes_together() && !state_.is_waking()) {
    state_.wake_nodes();
  }
}

void MessageServerExchange::begin() {
  ghosts_.start(state_.nodes.size());
  contacts_.start(state_.nodes.size());
}

void MessageServerExchange::begin_queries() {
  const auto queries = state_.setup.order->queries;
  if (queries.empty()) {
    return;
  }
  answers_.resize(std::max(answers_.size(), state_.nodes.size()));
  state_.all_nodes([&](PeerSession& node) {
    NodeQueries& answers = answers_[node.self.number()];
    answers.queries = queries;
    answers.frame = NodeQueries::no_frame;
    answers.hits.clear();
    node.opening.query_run.start(queries.size());
    return true;
  });
}

bool MessageServerExchange::send_queries(PeerSession& node) {
  return state_.send(node, node.opening.query_run, MessageType::query,
                     [&](std::size_t i) { return state_.setup.order->queries[i]; });
}

void MessageServerExchange::begin_senses() {
  const queries::RecordedFrame* const frame = state_.setup.publications->sensed;
  if (frame == nullptr || !state_.nodes_host()) {
    return;
  }
  sensed_.start(state_.nodes.size());
  for (std::uint32_t slot = 0; slot < state_.objects.slots(); ++slot) {
    const Endpoint host = state_.objects.host(slot);
    if (state_.objects.alive(slot) && host.is_node()) {
      sensed_.add(host.number(), state_.objects.row(slot).pose.position);
    }
  }
  const std::span<const queries::FrameObject> rows = frame->rows();
  state_.all_nodes([&](PeerSession& node) {
    std::vector<std::uint32_t>& sensed = node.opening.sensed;
    sensed.clear();
    for (std::uint32_t row = 0; row < rows.size(); ++row) {
      if (sensed_.reaches(node.self.number(), rows[row].pose.position,
                          frame->shapes().row(rows[row].shape).bounding_radius, state_.setup.sense)) {
        sensed.push_back(row);
      }
    }
    // Also if it is empty: the node hosts objects, whose queries find nothing.
    if (sensed_.any(node.self.number())) {
      node.opening.sensed_run.start(sensed.size());
    }
    return true;
  });
}

bool MessageServerExchange::send_sensed(PeerSession& node) {
  return state_.send(node, node.opening.sensed_run, MessageType::sensed, [&](std::size_t i) {
    const queries::RecordedFrame& frame = *state_.setup.publications->sensed;
    const std::uint32_t row = node.opening.sensed[i];
    const queries::FrameObject& object = frame.rows()[row];
    return messages::SensedRecord{object.pose,       object.user_data, object.number,
                                  object.generation, object.shape,     frame.group(row),
                                  object.layer,      object.category,  0};
  });
}

// The hits must be in order of query, of present objects, and only one for a query without a list.
bool MessageServerExchange::receive_hits(const PeerSession& node, const messages::MessageView& message) {
  if (state_.setup.order->queries.empty() || queries_of(node).frame == state_.frame) {
    return false;
  }
  NodeQueries& answers = answers_[node.self.number()];
  for (std::size_t i = 0; i < message.count(); ++i) {
    const auto hit = message.record<messages::QueryHitRecord>(i);
    if (hit.query >= answers.queries.size()) {
      return false;
    }
    const messages::QueryRecord& query = answers.queries[hit.query];
    const bool any = query.kind == static_cast<std::uint32_t>(messages::QueryKind::cast_any);
    const std::uint32_t last = answers.hits.empty() ? 0 : answers.hits.back().query;
    const bool repeated = !answers.hits.empty() && hit.query == last && !messages::has_list(query);
    if (hit.query < last || repeated || (!any && state_.objects.present()[hit.slot] == 0)) {
      return false;
    }
    answers.hits.push_back(hit);
  }
  if (message.last()) {
    answers.frame = state_.frame;
  }
  return true;
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

// The node sends a contact to the CD nodes that host its objects in the next frame, by the map of this one. It follows
// from the same values as ContactPublisher uses.
void MessageServerExchange::retract_contacts(const PeerSession& node, std::span<const UnlistedContact> unlisted) {
  if (!state_.nodes_host()) {
    return;
  }
  const NodeNumber finder = node.self.number();
  for (const UnlistedContact& contact : unlisted) {
    const NodeNumber first = next_host(contact.slot_a, finder);
    const NodeNumber second = next_host(contact.slot_b, finder);
    if (first != finder) {
      contacts_.retract(finder, first);
    }
    if (second != finder && second != first) {
      contacts_.retract(finder, second);
    }
  }
}

// The node itself for an object that no CD node hosts.
NodeNumber MessageServerExchange::next_host(std::uint32_t slot, NodeNumber finder) const noexcept {
  const ObjectRow& row = state_.objects.row(slot);
  const bool hosted_by_node = row.category != static_cast<std::uint16_t>(Category::avatar) &&
                              row.category != static_cast<std::uint16_t>(Category::fixed);
  return hosted_by_node ? state_.owner_at(row.pose.position) : finder;
}

void MessageServerExchange::cancel_contacts(NodeNumber node) {
  state_.all_nodes([&](PeerSession& other) {
    if (other.end_run.done()) {
      other.loss.records.back().contacts = contacts_.between(node, other.self.number());
    }
    return true;
  });
  contacts_.remove(node);
  state_.lost_finders.push_back(node);
}

void MessageServerExchange::count_records(Statistics& statistics) const noexcept {
  for (const PeerSession& node : state_.nodes) {
    if (state_.nodes_host() && node.is_active()) {
      count(statistics, {ghosts_.to(node.self.number()), contacts_.to(node.self.number())});
    }
  }
}

}  // namespace ringfence::nodes
