// The bridge of ClusterNodes: moves messages between the rings of the server's process and the network during a frame.
#include <algorithm>
#include <cstring>
#include <utility>

#include "dds/announcement.hpp"
#include "dds/cluster_nodes.hpp"
#include "messages/header.hpp"
#include "nodes/message_check.hpp"
#include "nodes/server/server_role.hpp"
#include "telemetry/clock.hpp"

namespace ringfence::dds {

using messages::Endpoint;
using nodes::Step;

// Reports lost nodes to the server. True if there was one; clears losses_ once none is pending.
bool ClusterNodes::report_losses() {
  bool any = false;
  losses_ = false;
  for (const auto& node : assigned_by_slot_) {
    if (node == nullptr || node->lost || !(node->broken || node->gone.load(std::memory_order_acquire))) {
      continue;
    }
    if (server_->lose(node->slot)) {
      node->lost = any = true;
      node->lost_ns = telemetry::now_ns();
    } else {
      losses_ = true;  // no frame is running; report it in the next
    }
  }
  return any;
}

Step ClusterNodes::step() {
  bool progressed = false;
  disarm();
  if (presence_waits_.load(std::memory_order_relaxed)) {
    const std::lock_guard lock(mutex_);
    note_presence();
  }
  losses_ |= member_is_gone_.exchange(false, std::memory_order_acquire);
  if (losses_) {
    progressed |= report_losses();
  }
  for (const auto& node : assigned_by_slot_) {
    if (node != nullptr) {
      progressed |= receive(*node);
      progressed |= !node->lost && carry(*node);
    }
  }
  // What comes through shared memory has no events, so most steps need no system call. But it does not keep events
  // back.
  constexpr std::uint32_t most_without_events = 16;
  if (!progressed || ++steps_without_events_ == most_without_events) {
    progressed |= take_events();
  }
  return progressed || !arm() ? Step::progressed : Step::idle;
}

bool ClusterNodes::take_events() {
  steps_without_events_ = 0;
  return events_.take([this](std::uint64_t incarnation) {
    const auto found = assigned_by_incarnation_.find(incarnation);
    if (found != assigned_by_incarnation_.end()) {
      found->second->parcel_channel->note_events();
    }
  });
}

// An idle step is the last one before the thread sleeps. Returns false if there is something to do.
bool ClusterNodes::arm() noexcept {
  armed_ = true;
  bool is_idle = true;
  for (const auto& node : assigned_by_slot_) {
    is_idle &= node == nullptr || node->parcel_channel->arm();
  }
  return is_idle;
}

void ClusterNodes::disarm() noexcept {
  if (!std::exchange(armed_, false)) {
    return;
  }
  for (const auto& node : assigned_by_slot_) {
    if (node != nullptr) {
      node->parcel_channel->disarm();
    }
  }
}

// What a lost node still sends is counted and dropped.
bool ClusterNodes::receive(Node& node) {
  auto show = [&](ParcelKind kind, std::uint32_t, std::size_t& offset, std::span<const std::byte> bytes) {
    if (node.lost) {
      stale_parcels_.fetch_add(1, std::memory_order_relaxed);
      return true;
    }
    return deliver(node, kind, offset, bytes);
  };
  const std::uint64_t before = node.parcel_channel->received();
  const bool progressed = node.parcel_channel->receive(show);
  if (node.parcel_channel->received() != before) {
    node.last_parcel_ns = telemetry::now_ns();
    if (node.first_parcel_ns.load(std::memory_order_relaxed) == 0) {
      node.first_parcel_ns.store(node.last_parcel_ns, std::memory_order_relaxed);
    }
  }
  if (node.parcel_channel->is_broken() && !node.broken) {
    node.broken = losses_ = true;
    return true;
  }
  return progressed;
}

bool ClusterNodes::deliver(Node& from, ParcelKind kind, std::size_t& offset, std::span<const std::byte> bytes) {
  if (kind == ParcelKind::peer_failed) {
    note_peer_failure(from, bytes);
  } else if (kind == ParcelKind::model_failed) {
    note_model_failure(from, bytes);
  } else if (kind == ParcelKind::assignment_query) {
    from.parcel_channel->enqueue(ParcelKind::assignment_reply, {});
  }
  if (kind != ParcelKind::messages) {
    return true;
  }
  const bool all = for_each_message(bytes, offset,
                                    [&](std::span<const std::byte> message) { return deliver_message(from, message); });
  publish(from);
  return all;
}

// Without the link the frame could not end, and the World cannot know which of the two is the cause. So the first
// report counts, and the node that it names is lost.
void ClusterNodes::note_peer_failure(Node& from, std::span<const std::byte> bytes) {
  PeerFailureRecord failure;
  if (bytes.size() != sizeof failure) {
    from.broken = losses_ = true;
    return;
  }
  std::memcpy(&failure, bytes.data(), sizeof failure);
  const auto peer = assigned_by_incarnation_.find(failure.incarnation);
  if (peer != assigned_by_incarnation_.end() && !peer->second->lost) {
    peer->second->broken = losses_ = true;
  }
}

// A node sends at most max_model_failures in a frame.
void ClusterNodes::note_model_failure(Node& from, std::span<const std::byte> bytes) {
  ModelFailureRecord record;
  const std::lock_guard lock(mutex_);
  if (bytes.size() != sizeof record || model_failures_.size() >= max_model_failures * assigned_by_slot_.size()) {
    from.broken = losses_ = true;
    return;
  }
  std::memcpy(&record, bytes.data(), sizeof record);
  const std::string text(record.text, strnlen(record.text, sizeof record.text));
  model_failures_.push_back({ObjectId{record.object}, printable(text.c_str())});
}

// The server role checks the messages that it receives; nodes in this process rely on this check.
bool ClusterNodes::is_from_node(const Node& from, NodeNumber to, std::span<const std::byte> message) const noexcept {
  const std::size_t state_bytes = (std::size_t{terms_record_.state_bytes} + 7) / 8 * 8;
  messages::MessageView view;
  return messages::decode(message, state_bytes, view) == Status::ok &&
         view.header().source == Endpoint::node(from.slot).value &&
         view.header().destination == Endpoint::node(to).value && nodes::is_between_nodes(view.type()) &&
         nodes::is_valid(view, {.nodes = static_cast<std::uint32_t>(assigned_by_slot_.size()),
                                .shapes = shapes_,
                                .slots = static_cast<std::uint32_t>(server_->objects().slots())});
}

bool ClusterNodes::deliver_message(Node& from, std::span<const std::byte> message) {
  if (message.size() < sizeof(messages::Header)) {
    from.broken = losses_ = true;
    return true;
  }
  const Endpoint to{read_once<messages::Header>(message).destination};
  if (!to.is_node()) {
    return copy_to_ring(message, *from.server.out);
  }
  const auto peer =
      std::find_if(from.peers.begin(), from.peers.end(), [&](const auto& each) { return each.first == to.number(); });
  if (peer == from.peers.end()) {
    from.broken = losses_ = true;  // messages to other node processes do not come here
    return true;
  }
  return copy_to_ring(message, *peer->second.out, [&](std::span<const std::byte> copy) {
    const bool is_valid = is_from_node(from, to.number(), copy);
    from.broken |= !is_valid;
    losses_ |= !is_valid;
    return is_valid;
  });
}

void ClusterNodes::publish(Node& node) {
  node.server.out->publish();
  for (const auto& [slot, connection] : node.peers) {
    connection.out->publish();
  }
}

// Sends to the node what the server and the nodes of this process have written for it. Returns whether there was
// anything.
bool ClusterNodes::carry(Node& node) {
  const std::uint64_t before = node.parcel_channel->sent();
  bool all = node.parcel_channel->gather(*node.server.in);
  for (std::size_t peer = 0; all && peer < node.peers.size(); ++peer) {
    all = node.parcel_channel->gather(*node.peers[peer].second.in);
  }
  node.parcel_channel->flush();
  return node.parcel_channel->sent() != before;
}

}  // namespace ringfence::dds
