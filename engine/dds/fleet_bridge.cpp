// The bridge of NodeFleet: what passes between the rings of the server's process and the network within a frame.
#include <algorithm>
#include <cstring>
#include <utility>

#include "dds/node_fleet.hpp"
#include "messages/header.hpp"
#include "nodes/server_role.hpp"
#include "telemetry/clock.hpp"

namespace ringfence::dds {

using messages::Endpoint;
using nodes::Step;

// True once no node that has gone is taken for one that lives.
bool NodeFleet::tell_losses() {
  bool told = false;
  losses_ = false;
  for (const auto& node : seats_) {
    if (node == nullptr || node->lost || !(node->broken || node->gone.load(std::memory_order_acquire))) {
      continue;
    }
    if (server_->lose(node->number)) {
      node->lost = told = true;
      node->lost_ns = telemetry::now_ns();
    } else {
      losses_ = true;  // no frame is under way: in the next
    }
  }
  return told;
}

Step NodeFleet::step() {
  bool progressed = false;
  if (presence_waits_.load(std::memory_order_relaxed)) {
    const std::lock_guard lock(mutex_);
    note_presence();
  }
  losses_ |= somebody_gone_.exchange(false, std::memory_order_acquire);
  if (losses_) {
    progressed |= tell_losses();
  }
  for (const auto& node : seats_) {
    if (node != nullptr && node->path->has_kept() && !node->lost) {
      auto show = [&](ParcelKind kind, std::uint32_t, std::size_t& offset, std::span<const std::byte> bytes) {
        return deliver(*node, kind, offset, bytes);
      };
      progressed |= node->path->deliver_kept(show);
    }
  }
  if (parcels_wait_.exchange(false, std::memory_order_acquire)) {
    progressed |= take_all<ParcelSample>(up_, [&](const ParcelSample& parcel, const dds_sample_info_t& info) {
      if (info.valid_data) {
        take_parcel(parcel);
      }
    });
  }
  for (const auto& node : seats_) {
    if (node != nullptr && !node->lost) {
      progressed |= carry(*node);
    }
  }
  return progressed ? Step::progressed : Step::idle;
}

void NodeFleet::take_parcel(const ParcelSample& parcel) {
  const auto found = seated_.find(parcel.incarnation);
  if (found == seated_.end() || found->second->lost) {
    // From before a loss, or from one that does not know yet that it has no seat.
    stale_parcels_.fetch_add(1, std::memory_order_relaxed);
    if (static_cast<ParcelKind>(parcel.kind) == ParcelKind::question) {
      const std::lock_guard lock(mutex_);
      const auto asker = nodes_.find(parcel.incarnation);
      if (asker != nodes_.end() && asker->second->path != nullptr) {
        asker->second->path->remark(ParcelKind::dismissed);
      }
    }
    return;
  }
  Node& node = *found->second;
  node.heard_ns = telemetry::now_ns();
  if (node.spoke_ns.load(std::memory_order_relaxed) == 0 && parcel.number != 0) {
    node.spoke_ns.store(node.heard_ns, std::memory_order_relaxed);
  }
  auto show = [&](ParcelKind kind, std::uint32_t, std::size_t& offset, std::span<const std::byte> bytes) {
    return deliver(node, kind, offset, bytes);
  };
  if (!node.path->receive(parcel, show)) {
    node.broken = losses_ = true;
  }
}

bool NodeFleet::deliver(Node& from, ParcelKind kind, std::size_t& offset, std::span<const std::byte> bytes) {
  if (kind != ParcelKind::messages) {
    return true;
  }
  const bool all = for_each_message(bytes, offset,
                                    [&](std::span<const std::byte> message) { return deliver_message(from, message); });
  publish(from);
  return all;
}

bool NodeFleet::deliver_message(Node& from, std::span<const std::byte> message) {
  messages::Header header;
  if (message.size() < sizeof header) {
    return true;  // no message
  }
  std::memcpy(&header, message.data(), sizeof header);
  const Endpoint to{header.destination};
  link::Sender* out = from.server.out;
  if (to.is_node()) {
    if (to.number() >= seats_.size()) {
      return true;
    }
    if (Node* other = seats_[to.number()].get()) {
      return other->lost || other->path->add(message);
    }
    const auto peer =
        std::find_if(from.peers.begin(), from.peers.end(), [&](const auto& each) { return each.first == to.number(); });
    out = peer == from.peers.end() ? nullptr : peer->second.out;
  }
  return out == nullptr || pass_on(message, *out);
}

void NodeFleet::publish(Node& node) {
  node.server.out->publish();
  for (const auto& [number, line] : node.peers) {
    line.out->publish();
  }
}

// What server and nodes of this process have said to the node goes out. Whether there was anything.
bool NodeFleet::carry(Node& node) {
  const std::uint64_t before = node.path->sent();
  bool all = node.path->gather(*node.server.in);
  for (std::size_t peer = 0; all && peer < node.peers.size(); ++peer) {
    all = node.path->gather(*node.peers[peer].second.in);
  }
  node.path->flush();
  node.path->acknowledge();
  return node.path->sent() != before;
}

}  // namespace ringfence::dds
