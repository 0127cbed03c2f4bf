#include "nodes/server/frame/reported_states.hpp"

#include <algorithm>

#include "base/prefetch.hpp"
#include "telemetry/clock.hpp"

namespace ringfence::nodes {

void ReportedStates::prefetch_records(std::span<const std::byte> message) noexcept {
  constexpr std::size_t most = 1024;
  for (std::size_t at = 64; at < std::min(message.size(), most); at += 64) {
    base::prefetch_for_read(message.data() + at);
  }
}

void ReportedStates::prefetch_objects(std::span<const std::byte> bytes) const noexcept {
  messages::MessageView message;
  if (messages::decode(bytes, state_.objects.state_bytes(), message) != Status::ok ||
      message.type() != messages::MessageType::node_state) {
    return;
  }
  for (std::size_t i = 0; i < std::min(message.count(), ahead); ++i) {
    prefetch_object(message, i);
  }
}

void ReportedStates::prefetch_object(const messages::MessageView& message, std::size_t i) const noexcept {
  const auto& object = message.view<messages::ObjectRef>(i);
  const bool sweeps = state_.setup.placement == Placement::server;
  state_.objects.prefetch(object.slot, sweeps || (object.flags & messages::flag_interior) == 0);
}

void ReportedStates::receive(PeerSession& node, const messages::MessageView& message) {
  state_.state_senders += node.received.bytes == 0 ? 1 : 0;
  node.received.bytes += message.header().bytes;
  const std::uint64_t start = telemetry::now_ns();
  const bool nodes_keep_states = states_.nodes_keep_states();
  ObjectTable& objects = state_.objects;
  const regions::CellGrid& grid = state_.map.grid();
  for (std::size_t i = 0; i < message.count(); ++i) {
    if (i + ahead < message.count()) {
      prefetch_object(message, i + ahead);
    }
    if (i + 2 * ahead < message.count()) {
      base::prefetch_for_read(message.at(i + 2 * ahead));
      base::prefetch_for_read(message.at(i + 2 * ahead) + 64);
    }
    const auto& record = message.view<messages::NodeStateRecord>(i);
    const std::uint32_t slot = objects.find(record.object);
    if (slot == base::NumberIndex::none || objects.host(slot) != node.self) {
      state_.refuse(slot == base::NumberIndex::none ? Status::stale_object : Status::not_host);
      continue;
    }
    ObjectRow& row = objects.change_row(slot);
    row.pose = record.pose;
    row.object.flags = record.object.flags & messages::flag_present;
    objects.set_jumped(slot, (record.object.flags & messages::flag_jumped) != 0);
    // An object outside its own bounds may leave the only node that knows it; then the notified nodes must be recorded.
    constexpr std::uint32_t at_home = messages::flag_interior | messages::flag_keeps_host;
    const bool inner = (record.object.flags & at_home) == at_home;
    ObjectMarks& marks = objects.marks(slot);
    const bool was_host_owned = (marks & host_owned_mark) != 0;
    const bool host_owned = (record.object.flags & messages::flag_host_owned) != 0 && state_.hosts_send_ghosts();
    marks = static_cast<ObjectMarks>((marks & ~host_owned_mark) | reported_mark | (inner ? inner_mark : 0) |
                                     (host_owned ? host_owned_mark : 0));
    // Counted as moved, but it has not.
    states_.add_moved((record.object.flags & messages::flag_at_rest) != 0 ? -1 : 0);
    if ((record.object.flags & messages::flag_keeps_host) == 0) {
      state_.leaving.push_back({slot, state_.owner_at(record.pose.position)});
    }
    if (nodes_keep_states) {
      marks |= no_state_mark;
    } else {
      std::copy_n(message.state<messages::NodeStateRecord>(i), objects.state_bytes(), objects.new_state(slot));
    }
    if (was_host_owned && host_owned) {  // its host has sent the object to the other nodes
      states_.note_stale_bounds();
      objects.mark_moved_host_only(slot);
      continue;
    }
    objects.bounds(slot) = record.bounds;
    if (was_host_owned) {
      objects.note_notified(slot, record.bounds, grid, !inner);
      objects.mark_moved_host_only(slot);
      continue;
    }
    const bool host_alone = inner && (marks & shared_mark) == 0;  // only the host needs to know the object
    if (host_alone) {
      marks |= notified_mark;
      objects.mark_moved_host_only(slot);
    } else {
      objects.mark_moved(slot);
    }
  }
  node.received.states |= message.last();
  statistics_.add_ingest(telemetry::now_ns() - start);
}

// The other nodes have received the object from its host.
bool ReportedStates::receive_replicas(PeerSession& node, const messages::MessageView& message) {
  const std::uint64_t start = telemetry::now_ns();
  ObjectTable& objects = state_.objects;
  for (std::size_t i = 0; i < message.count(); ++i) {
    if (i + ahead < message.count()) {
      objects.prefetch(message.view<messages::ReplicaRecord>(i + ahead).slot, false);
    }
    const auto& record = message.view<messages::ReplicaRecord>(i);
    const std::uint32_t slot = record.slot;
    const bool current = slot < objects.slots() && (objects.marks(slot) & host_owned_mark) != 0 &&
                         objects.host(slot) == node.self && objects.row(slot).object.generation == record.generation;
    if (!current) {
      return false;
    }
    objects.change_row(slot).pose = record.pose;
    objects.marks(slot) |= reported_mark;
    std::copy_n(message.state<messages::ReplicaRecord>(i), objects.state_bytes(), objects.new_state(slot));
    objects.mark_moved_host_only(slot);
  }
  states_.note_stale_bounds();
  statistics_.add_ingest(telemetry::now_ns() - start);
  return true;
}

}  // namespace ringfence::nodes
