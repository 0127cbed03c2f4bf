#include "nodes/server/frame/node_ingest.hpp"

#include <algorithm>

#include "base/prefetch.hpp"
#include "nodes/message_check.hpp"
#include "telemetry/clock.hpp"

namespace ringfence::nodes {

using messages::MessageType;
using messages::MessageView;

namespace {

/// Whether messages of this type hold results of a region map. If a node is lost, they are void: all nodes find them
/// again with the next map.
bool belongs_to_map(MessageType type) noexcept {
  return type == MessageType::collision || type == MessageType::change || type == MessageType::contact_counts ||
         type == MessageType::narrow_done;
}

}  // namespace

bool NodeIngest::receive() {
  if (state_.setup.frame_control != nullptr) {
    return receive_reports();
  }
  bool any = false;
  state_.all_nodes([&](PeerSession& node) {
    any |= is_awaited(node) && drain(node);
    return true;
  });
  return any;
}

bool NodeIngest::receive_reports() {
  reports_.look();
  const bool any = receive_from_senders();
  return reports_.accept() || any;
}

// A session, the receiver, the message, its records and their objects are on lines that this core has not had since the
// last step: reads that depend on each other are prefetched in a pipeline.
bool NodeIngest::receive_from_senders() {
  constexpr std::size_t ahead = 4, stages = 5;
  senders_.clear();
  state_.setup.frame_control->take_senders([this](NodeNumber slot) {
    if (slot < state_.nodes.size() && state_.nodes[slot].is_active()) {
      senders_.push_back(slot);
    }
  });
  const auto behind = [this](std::size_t i, std::size_t by) {
    return i >= by && i - by < senders_.size() ? &state_.nodes[senders_[i - by]] : nullptr;
  };
  bool any = false;
  for (std::size_t i = 0; i < senders_.size() + stages * ahead; ++i) {
    if (const PeerSession* node = behind(i, 0)) {
      base::prefetch_for_read(&node->connection);
    }
    if (const PeerSession* node = behind(i, ahead)) {
      base::prefetch_for_write(node->connection.in);
    }
    if (const PeerSession* node = behind(i, 2 * ahead)) {
      node->connection.in->prefetch();
    }
    if (const PeerSession* node = behind(i, 3 * ahead)) {
      ReportedStates::prefetch_records(node->connection.in->peek());
    }
    if (const PeerSession* node = behind(i, 4 * ahead)) {
      reported_states_.prefetch_objects(node->connection.in->peek());
    }
    if (PeerSession* node = behind(i, stages * ahead)) {
      any |= node->is_active() && drain(*node);
    }
  }
  return any;
}

bool NodeIngest::all_completed(ReportedStep step) {
  if (state_.setup.frame_control != nullptr && state_.report().lost.empty()) {
    return reports_.all(step);
  }
  return state_.all_nodes([&](PeerSession& node) { return has_completed(node.received, step); });
}

// Whether the frame waits for a message of the node.
bool NodeIngest::is_awaited(const PeerSession& node) const noexcept {
  switch (state_.stage) {
    case FrameStage::waiting:
      return false;
    case FrameStage::starting_nodes:
    case FrameStage::starting_users:
    case FrameStage::moving:
      return !node.received.states || node.probed_ns != 0;
    case FrameStage::dispatching:
    case FrameStage::colliding:
    case FrameStage::notifying:
      return !node.received.narrow_done || node.probed_ns != 0;
    case FrameStage::notifying_users:
      return node.probed_ns != 0;
    case FrameStage::closing:
      return !node.received.frame_done || node.probed_ns != 0;
  }
  return true;
}

bool NodeIngest::drain(PeerSession& node) {
  bool any = false;
  for (auto bytes = node.connection.in->next(); !bytes.empty(); bytes = node.connection.in->next()) {
    any = true;
    MessageView message;
    if (node.broken) [[unlikely]] {
      state_.refuse(Status::late);
    } else if (messages::decode(bytes, state_.objects.state_bytes(), message) == Status::ok &&
               message.header().source == node.self.value &&
               (message.header().frame == state_.frame || message.type() == MessageType::probe_reply)) {
      // A probe reply may be one frame late.
      receive(node, message);
    } else {
      refuse(node);
    }
  }
  if (any) {
    node.connection.in->release();
    if (state_.setup.node_deadline_ns != 0) {
      node.last_received_ns = telemetry::now_ns();
      node.probed_ns = 0;
    }
  }
  return any;
}

bool NodeIngest::refuse_lost() {
  bool any = false;
  for (PeerSession& node : state_.nodes) {
    if (node.lost && node.connection.in->has_message()) {
      while (!node.connection.in->next().empty()) {
        state_.refuse(Status::late);
      }
      node.connection.in->release();
      any = true;
    }
  }
  return any;
}

// A CD node of another process that breaks the protocol becomes lost, because its contacts of the frame cannot be
// trusted.
void NodeIngest::refuse(PeerSession& sender) {
  state_.refuse(Status::bad_message);
  if (!exchange_.trusts_nodes()) {
    sender.broken = any_broken_ = true;
  }
}

// Whether a CD node of another process may send this message now, and its records are valid. States are final after the
// last one has arrived, and contacts after narrow_done: other roles read them from then on.
bool NodeIngest::is_acceptable(const PeerSession& node, const MessageView& message) const noexcept {
  switch (message.type()) {
    case MessageType::node_state:
    case MessageType::replica:
    case MessageType::ghost_counts:
      if (node.received.states || state_.stage > FrameStage::moving) {
        return false;
      }
      break;
    case MessageType::collision:
    case MessageType::change:
    case MessageType::contact_counts:
    case MessageType::narrow_done:
      if (node.received.narrow_done ||
          (state_.stage != FrameStage::dispatching && state_.stage != FrameStage::colliding)) {
        return false;
      }
      break;
    case MessageType::query_hit:
      if (node.received.frame_done || !state_.contacts_are_final()) {
        return false;
      }
      break;
    default:
      break;
  }
  return is_valid(message, {.nodes = static_cast<std::uint32_t>(state_.nodes.size()),
                            .shapes = static_cast<std::uint32_t>(state_.setup.shapes->size()),
                            .slots = static_cast<std::uint32_t>(state_.objects.slots())});
}

// Whether the protocol allows a message of this type from a CD node now.
bool NodeIngest::may_send(const PeerSession& node, const MessageView& message) const noexcept {
  switch (message.type()) {
    case MessageType::node_state:
    case MessageType::replica:
    case MessageType::collision:
    case MessageType::change:
    case MessageType::probe_reply:
    case MessageType::kinds:
    case MessageType::query_hit:
    case MessageType::ghost_counts:
    case MessageType::contact_counts:
      return true;
    case MessageType::narrow_done:
      return message.count() == 1;
    case MessageType::frame_done:
      // Accepted once, and only after the contacts that it acknowledges have been sent.
      return message.count() == 1 && !node.received.frame_done && state_.contacts_are_final() && node.end_run.done();
    default:
      return false;
  }
}

void NodeIngest::receive(PeerSession& node, const MessageView& message) {
  statistics_.count(message.header());
  if (belongs_to_map(message.type()) && message.header().epoch != state_.map.epoch()) {
    return;  // found before a loss was known; the node will find it again
  }
  if (!may_send(node, message) || !(exchange_.trusts_nodes() || is_acceptable(node, message)) || !take(node, message)) {
    refuse(node);
  }
}

// Returns false if the content breaks the protocol.
bool NodeIngest::take(PeerSession& node, const MessageView& message) {
  switch (message.type()) {
    case MessageType::node_state:
      reported_states_.receive(node, message);
      return true;
    case MessageType::replica:
      return reported_states_.receive_replicas(node, message);
    case MessageType::collision:
      return receive_collisions(node, message);
    case MessageType::change:
      return receive_changes(node, message);
    case MessageType::narrow_done:
      return results_.add_tests(node, message.record<messages::NarrowDoneRecord>(0));
    case MessageType::ghost_counts:
    case MessageType::contact_counts:
      return exchange_.receive_counts(node, message);
    case MessageType::query_hit:
      return exchange_.receive_hits(node, message);
    case MessageType::kinds:
      for (std::size_t i = 0; i < message.count(); ++i) {
        results_.add_kinds(std::span(&message.view<messages::KindRecord>(i), 1));
      }
      return true;
    case MessageType::frame_done:
      results_.finish(node, message.record<messages::NodeFrameStats>(0));
      return true;
    default:
      return true;  // a probe_reply has no content
  }
}

bool NodeIngest::receive_collisions(PeerSession& node, const MessageView& message) {
  constexpr std::size_t ahead = 12;
  const std::span<const std::uint8_t> present = state_.objects.present();
  const ContactObjects objects = state_.objects.contact_objects();
  for (std::size_t i = 0; i < message.count(); ++i) {
    if (i + ahead < message.count()) {
      const auto& soon = message.view<messages::CollisionRecord>(i + ahead);
      objects.prefetch(soon.slot_a);
      objects.prefetch(soon.slot_b);
    }
    const auto& record = message.view<messages::CollisionRecord>(i);
    if (present[record.slot_a] == 0 || present[record.slot_b] == 0 ||
        !state_.ledger.receive(node.self.number(), record, objects)) {
      return false;
    }
  }
  return true;
}

bool NodeIngest::receive_changes(PeerSession& node, const MessageView& message) {
  for (std::size_t i = 0; i < message.count(); ++i) {
    if (!state_.ledger.receive(node.self.number(), message.record<messages::ChangeRecord>(i))) {
      return false;
    }
  }
  return true;
}

}  // namespace ringfence::nodes
