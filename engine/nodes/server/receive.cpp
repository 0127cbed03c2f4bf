// Messages that the server receives from CD nodes and user nodes.
#include <algorithm>

#include "base/prefetch.hpp"
#include "nodes/message_check.hpp"
#include "nodes/server/server_role.hpp"
#include "telemetry/clock.hpp"

namespace ringfence::nodes {

using messages::MessageType;
using messages::MessageView;

// Reads the messages of a peer up to a limit for users: a flooding user must not keep the others waiting.
bool ServerRole::drain(PeerSession& session) {
  constexpr std::size_t max_bytes_at_once = 65536;
  bool any = false;
  std::size_t taken = 0;
  for (auto bytes = session.connection.in->next(); !bytes.empty();
       bytes = taken < max_bytes_at_once ? session.connection.in->next() : std::span<const std::byte>{}) {
    taken += session.self.is_user() ? bytes.size() : 0;
    MessageView message;
    if (session.broken) [[unlikely]] {
      refuse(Status::late);
    } else if (session.self.is_user() && is_over_quota(session, bytes)) {
      refuse(session, Status::over_quota);
    } else if (messages::decode(bytes, objects_.state_bytes(), message) == Status::ok &&
               message.header().source == session.self.value &&
               (message.header().frame == frame_ || message.type() == MessageType::probe_reply)) {
      // A probe reply may be one frame late.
      receive(session, message);
    } else {
      refuse(session, Status::bad_message);
    }
    any = true;
  }
  if (any) {
    session.connection.in->release();
    if (setup_.node_deadline_ns != 0) {
      session.last_received_ns = telemetry::now_ns();
      session.probed_ns = 0;
    }
  }
  return any;
}

// Whether the message exceeds its sender's quota and is ignored. The end of the states and frame_done count
// nevertheless: otherwise the frame would wait for them.
bool ServerRole::is_over_quota(PeerSession& session, std::span<const std::byte> bytes) {
  session.received_bytes += bytes.size();
  if (setup_.quotas.bytes == 0 || session.received_bytes <= setup_.quotas.bytes) {
    return false;
  }
  MessageView message;
  const bool valid = messages::decode(bytes, objects_.state_bytes(), message) == Status::ok &&
                     message.header().source == session.self.value && message.header().frame == frame_;
  if (valid && message.type() == MessageType::frame_done) {
    return false;
  }
  session.states_received |= valid && message.type() == MessageType::state_update && message.last();
  return true;
}

// Counts all refusals, and reports only the first ones: a user node that sends invalid messages must not make the
// server send as many. A CD node of another process that breaks the protocol becomes lost, because its contacts of the
// frame cannot be trusted.
void ServerRole::refuse(PeerSession& sender, Status reason, ObjectNumber number) {
  refuse(reason);
  if (sender.self.is_node() && sender.connection.node_contacts == nullptr && reason == Status::bad_message) {
    sender.broken = any_broken_ = true;
  }
  if (sender.self.is_user() && sender.new_refusals.size() < PeerSession::max_refusals) {
    sender.new_refusals.push_back({number, static_cast<std::uint32_t>(reason)});
  }
}

// Whether a CD node of another process may send this message now, and its records are valid. States are final after the
// last one has arrived, and contacts after narrow_done: other roles read them from then on.
bool ServerRole::is_acceptable(const PeerSession& node, const MessageView& message) const noexcept {
  switch (message.type()) {
    case MessageType::node_state:
      if (node.states_received || stage_ > Stage::moving) {
        return false;
      }
      break;
    case MessageType::collision:
    case MessageType::change:
    case MessageType::narrow_done:
      if (node.narrow_done_received || (stage_ != Stage::dispatching && stage_ != Stage::colliding)) {
        return false;
      }
      break;
    default:
      break;
  }
  return is_valid(message, {.nodes = static_cast<std::uint32_t>(nodes_.size()),
                            .shapes = static_cast<std::uint32_t>(setup_.shapes->size()),
                            .slots = static_cast<std::uint32_t>(objects_.slots())});
}

void ServerRole::receive(PeerSession& session, const MessageView& message) {
  add(report().traffic, message.header());
  const bool node = session.self.is_node();
  const bool tests = message.type() == MessageType::collision || message.type() == MessageType::change ||
                     message.type() == MessageType::narrow_done;
  if (node && tests && message.header().epoch != map_.epoch()) {
    return;  // found before a loss was known; the node will find it again
  }
  if (node && session.connection.node_contacts == nullptr && !is_acceptable(session, message)) {
    return refuse(session, Status::bad_message);
  }
  switch (message.type()) {
    case MessageType::state_update:
      // Poses are final after a host's last state message: a later state would reach some nodes and not others.
      return node || session.states_received ? refuse(session, Status::bad_message) : receive_states(session, message);
    case MessageType::node_state:
      return node ? receive_node_states(session, message) : refuse(session, Status::bad_message);
    case MessageType::collision:
      return node ? receive_collisions(session, message) : refuse(session, Status::bad_message);
    case MessageType::change:
      return node ? receive_changes(session, message) : refuse(session, Status::bad_message);
    case MessageType::narrow_done:
      return node && message.count() == 1 ? receive_narrow_done(session, message)
                                          : refuse(session, Status::bad_message);
    case MessageType::published:
      return node ? void(session.published_received = true) : refuse(session, Status::bad_message);
    case MessageType::probe_reply:
      return node ? void() : refuse(session, Status::bad_message);
    case MessageType::kinds:
      return node ? receive_kinds(message) : refuse(session, Status::bad_message);
    case MessageType::frame_done:
      // Accepted once, and only after the contacts that it acknowledges have been sent.
      return message.count() == 1 && !session.frame_done_received && contacts_are_final() && session.notice_run.done()
                 ? receive_frame_done(session, message)
                 : refuse(session, Status::bad_message);
    default:
      return refuse(session, Status::bad_message);
  }
}

// M1. User nodes are not trusted: a state is accepted only if the user hosts the object and the pose is valid.
void ServerRole::receive_states(PeerSession& session, const MessageView& message) {
  const std::uint64_t start = telemetry::now_ns();
  for (std::size_t i = 0; i < message.count(); ++i) {
    auto record = message.record<messages::StateRecord>(i);
    if (setup_.quotas.updates != 0 && ++session.received_updates > setup_.quotas.updates) {
      refuse(session, Status::over_quota, record.object.number);
      continue;
    }
    const std::uint32_t slot = objects_.find(record.object);
    if (slot == base::NumberIndex::none) {
      refuse(session, Status::stale_object, record.object.number);
      continue;
    }
    ObjectRow& row = objects_.row(slot);
    if (objects_.host(slot) != session.self) {
      refuse(session, Status::not_host, record.object.number);
      continue;
    }
    if (const Status status = make_valid(record.pose); status != Status::ok) {
      refuse(session, status, record.object.number);
      continue;
    }
    row.pose = record.pose;
    row.object.flags = record.object.flags & messages::flag_present;
    objects_.bounds(slot) = setup_.shapes->bounds(row.shape, row.pose, *setup_.space);
    std::copy_n(message.state<messages::StateRecord>(i), objects_.state_bytes(), objects_.state(slot));
    objects_.mark_moved(slot);
  }
  session.states_received |= message.last();
  ingest_ns_ += telemetry::now_ns() - start;
}

void ServerRole::receive_node_states(PeerSession& session, const MessageView& message) {
  const std::uint64_t start = telemetry::now_ns();
  constexpr std::size_t ahead = 12;
  const bool sweeps = setup_.placement == Placement::server;
  for (std::size_t i = 0; i < message.count(); ++i) {
    if (i + ahead < message.count()) {
      const auto& soon = message.view<messages::ObjectRef>(i + ahead);
      objects_.prefetch(soon.slot, sweeps || (soon.flags & messages::flag_interior) == 0);
    }
    if (i + 2 * ahead < message.count()) {
      base::prefetch_for_read(message.at(i + 2 * ahead));
      base::prefetch_for_read(message.at(i + 2 * ahead) + 64);
    }
    const auto& record = message.view<messages::NodeStateRecord>(i);
    const std::uint32_t slot = objects_.find(record.object);
    if (slot == base::NumberIndex::none || objects_.host(slot) != session.self) {
      refuse(session, slot == base::NumberIndex::none ? Status::stale_object : Status::not_host, record.object.number);
      continue;
    }
    ObjectRow& row = objects_.row(slot);
    row.pose = record.pose;
    row.object.flags = record.object.flags & messages::flag_present;
    // An object outside its own bounds may leave the only node that knows it; then the notified nodes must be recorded.
    constexpr std::uint32_t at_home = messages::flag_interior | messages::flag_keeps_host;
    const bool inner = (record.object.flags & at_home) == at_home;
    ObjectMarks& marks = objects_.marks(slot);
    const bool was_host_owned = (marks & host_owned_mark) != 0;
    const bool host_owned =
        (record.object.flags & messages::flag_host_owned) != 0 && session.connection.node_contacts != nullptr;
    marks = static_cast<ObjectMarks>((marks & ~host_owned_mark) | reported_mark | (inner ? inner_mark : 0) |
                                     (host_owned ? host_owned_mark : 0));
    // Counted as moved, but it has not.
    host_owned_moved_ -= (record.object.flags & messages::flag_at_rest) != 0 ? 1 : 0;
    if ((record.object.flags & messages::flag_keeps_host) == 0) {
      leaving_slots_.push_back(slot);
    }
    std::copy_n(message.state<messages::NodeStateRecord>(i), objects_.state_bytes(), objects_.state(slot));
    if (was_host_owned) {
      note_notified(slot, record.bounds, !inner);
      objects_.mark_moved_host_only(slot);
      continue;
    }
    const bool host_alone = inner && (marks & shared_mark) == 0;  // only the host needs to know the object
    if (sweeps || !host_alone || session.connection.node_contacts != nullptr) {
      objects_.bounds(slot) = record.bounds;
    } else {
      bounds_are_stale_ = true;  // saves a cache line per state; the bounds are computed from the pose when needed
    }
    if (host_alone) {
      marks |= notified_mark;
      objects_.mark_moved_host_only(slot);
    } else {
      objects_.mark_moved(slot);
    }
  }
  session.states_received |= message.last();
  ingest_ns_ += telemetry::now_ns() - start;
}

// The host has sent the object to the nodes whose regions these bounds touch; without `shared` they touch only the
// host's.
void ServerRole::note_notified(std::uint32_t slot, const geometry::Bounds& bounds, bool shared) {
  const bool present = (objects_.row(slot).object.flags & messages::flag_present) != 0;
  objects_.bounds(slot) = objects_.notified_bounds(slot) = bounds;
  objects_.notified_cells(slot) = map_.grid().cells_of(bounds);
  ObjectMarks& marks = objects_.marks(slot);
  marks = static_cast<ObjectMarks>((marks & ~(notified_mark | shared_mark)) | (present ? notified_mark : 0) |
                                   (shared ? shared_mark : 0));
}

void ServerRole::receive_collisions(PeerSession& session, const MessageView& message) {
  constexpr std::size_t ahead = 8;  // 64,000 rows do not fit the second-level cache
  for (std::size_t i = 0; i < message.count(); ++i) {
    if (i + ahead < message.count()) {
      const auto& soon = message.view<messages::CollisionRecord>(i + ahead);
      base::prefetch_for_read(&objects_.row(soon.slot_a));
      base::prefetch_for_read(&objects_.row(soon.slot_b));
      base::prefetch_for_read(objects_.origins().data() + soon.slot_a);
      base::prefetch_for_read(objects_.origins().data() + soon.slot_b);
    }
    const auto& record = message.view<messages::CollisionRecord>(i);
    const bool present = objects_.present()[record.slot_a] != 0 && objects_.present()[record.slot_b] != 0;
    if (!present || !ledger_.receive(session.self.number(), record, objects_.rows(), objects_.origins())) {
      return refuse(session, Status::bad_message);
    }
  }
}

void ServerRole::receive_changes(PeerSession& session, const MessageView& message) {
  for (std::size_t i = 0; i < message.count(); ++i) {
    if (!ledger_.receive(session.self.number(), message.record<messages::ChangeRecord>(i))) {
      return refuse(session, Status::bad_message);
    }
  }
}

// A node's results count only as a whole: when it reports the number of tested pairs, and all its contacts are here.
void ServerRole::receive_narrow_done(PeerSession& session, const MessageView& message) {
  const auto record = message.record<messages::NarrowDoneRecord>(0);
  NodeReport& node = report().nodes[session.in_report];
  node.candidates = record.candidates;
  node.tested = record.tested;
  node.contacts = record.contacts;
  node.failed_supports = record.failed_supports;
  report().failed_supports += record.failed_supports;
  report().tested += record.tested;
  if (NodeContacts* const node_contacts = session.connection.node_contacts) {
    ledger_.receive(session.self.number(), *node_contacts);
    count_shared(Traffic::m3, node_contacts->keys.size(), sizeof(messages::CollisionRecord));
  } else {
    ledger_.end_run(session.self.number());
  }
  if (ledger_.received(session.self.number()) == record.contacts) {
    report().accepted += record.tested;
  } else {
    refuse(session, Status::bad_message);
  }
  if (setup_.placement == Placement::region) {
    report().candidates += record.candidates;
  }
  session.narrow_done_received = true;
}

void ServerRole::receive_kinds(const MessageView& message) {
  auto& kinds = report().kinds;
  for (std::size_t i = 0; i < message.count(); ++i) {
    const auto record = message.record<messages::KindRecord>(i);
    const auto first = static_cast<ShapeKind>(record.first);
    const auto second = static_cast<ShapeKind>(record.second);
    auto at = std::find_if(kinds.begin(), kinds.end(),
                           [&](const KindReport& kind) { return kind.first == first && kind.second == second; });
    if (at == kinds.end()) {
      at = kinds.emplace(kinds.end());
      at->first = first;
      at->second = second;
    }
    at->candidates += record.candidates;
    at->hits += record.hits;
    at->lanes += record.lanes;
    at->lanes_filled += record.lanes_filled;
    at->iterations += record.iterations;
    at->ended_early += record.ended_early;
    at->timed += record.timed;
    at->nanoseconds += record.nanoseconds;
    at->gather_nanoseconds += record.gather_nanoseconds;
    for (std::size_t k = 0; k < cost_buckets; ++k) at->cost[k] += record.cost[k];
  }
}

void ServerRole::receive_frame_done(PeerSession& session, const MessageView& message) {
  const auto record = message.record<messages::NodeFrameStats>(0);
  FrameReport& frame = report();
  frame.refused[static_cast<std::size_t>(Status::model_failed)] += record.model_failed;
  frame.refused[static_cast<std::size_t>(Status::not_finite)] += record.not_finite;
  frame.refused[static_cast<std::size_t>(Status::not_unit)] += record.not_unit;
  if (session.self.is_node()) {
    NodeReport& node = frame.nodes[session.in_report];
    node.busy_ms = telemetry::to_ms(record.busy_ns);
    node.cpu_ms = telemetry::to_ms(record.cpu_ns);
    node.move_ms = telemetry::to_ms(record.move_ns);
    node.broad_phase_ms = telemetry::to_ms(record.broad_phase_ns);
    node.narrow_phase_ms = telemetry::to_ms(record.narrow_phase_ns);
    charge_path(session, record);
    session.cost_ms = cost_of(node);
    node.hosted = record.hosted;
    if (record.host_owned_changes != 0) {
      host_owned_moved_ += static_cast<std::int64_t>(record.host_owned_changes);
      count_shared(Traffic::state, record.host_owned_changes,
                   sizeof(messages::NodeStateRecord) + objects_.state_bytes());
    }
    node.handed_over = record.handed_over;
    TrafficReport& m5 = frame.traffic[static_cast<std::size_t>(Traffic::m5)];
    m5.messages += record.m5_messages;
    m5.records += record.handed_over;
    m5.bytes += record.m5_bytes;
  } else {
    // Every user node also sends its states to the others, once: the publication.
    TrafficReport& m1 = frame.traffic[static_cast<std::size_t>(Traffic::m1)];
    m1.records += record.published;
    m1.bytes += record.published * sizeof(link::PublishedState);
  }
  session.frame_done_received = true;
}

}  // namespace ringfence::nodes
