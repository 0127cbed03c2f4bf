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
      state_.refuse(Status::late);
    } else if (session.self.is_user() && is_over_quota(session, bytes)) {
      refuse(session, Status::over_quota);
    } else if (messages::decode(bytes, state_.objects.state_bytes(), message) == Status::ok &&
               message.header().source == session.self.value &&
               (message.header().frame == state_.frame || message.type() == MessageType::probe_reply)) {
      // A probe reply may be one frame late.
      receive(session, message);
    } else {
      refuse(session, Status::bad_message);
    }
    any = true;
  }
  if (any) {
    session.connection.in->release();
    if (state_.setup.node_deadline_ns != 0) {
      session.last_received_ns = telemetry::now_ns();
      session.probed_ns = 0;
    }
  }
  return any;
}

// Refuses the messages of a lost node. Returns whether there were any.
bool ServerRole::drain_lost(PeerSession& session) {
  bool any = false;
  for (auto bytes = session.connection.in->next(); !bytes.empty(); bytes = session.connection.in->next()) {
    state_.refuse(Status::late);
    any = true;
  }
  if (any) {
    session.connection.in->release();
  }
  return any;
}

// Whether the message exceeds its sender's quota and is ignored. The end of the states and frame_done count
// nevertheless: otherwise the frame would wait for them.
bool ServerRole::is_over_quota(PeerSession& session, std::span<const std::byte> bytes) {
  session.received.bytes += bytes.size();
  if (state_.setup.quotas.bytes == 0 || session.received.bytes <= state_.setup.quotas.bytes) {
    return false;
  }
  MessageView message;
  const bool valid = messages::decode(bytes, state_.objects.state_bytes(), message) == Status::ok &&
                     message.header().source == session.self.value && message.header().frame == state_.frame;
  if (valid && message.type() == MessageType::frame_done) {
    return false;
  }
  session.received.states |= valid && message.type() == MessageType::state_update && message.last();
  return true;
}

// Counts all refusals, and reports only the first ones: a user node that sends invalid messages must not make the
// server send as many. A CD node of another process that breaks the protocol becomes lost, because its contacts of the
// frame cannot be trusted.
void ServerRole::refuse(PeerSession& sender, Status reason, ObjectNumber number) {
  state_.refuse(reason);
  if (sender.self.is_node() && !SharedNodes::is_shared(sender) && reason == Status::bad_message) {
    sender.broken = any_broken_ = true;
  }
  if (sender.self.is_user() && sender.received.refusals.size() < PeerSession::Received::max_refusals) {
    sender.received.refusals.push_back({number, static_cast<std::uint32_t>(reason)});
  }
}

// Whether a CD node of another process may send this message now, and its records are valid. States are final after the
// last one has arrived, and contacts after narrow_done: other roles read them from then on.
bool ServerRole::is_acceptable(const PeerSession& node, const MessageView& message) const noexcept {
  switch (message.type()) {
    case MessageType::node_state:
      if (node.received.states || state_.stage > FrameStage::moving) {
        return false;
      }
      break;
    case MessageType::collision:
    case MessageType::change:
    case MessageType::narrow_done:
      if (node.received.narrow_done ||
          (state_.stage != FrameStage::dispatching && state_.stage != FrameStage::colliding)) {
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

void ServerRole::receive(PeerSession& session, const MessageView& message) {
  statistics_.count(message.header());
  const bool node = session.self.is_node();
  const bool tests = message.type() == MessageType::collision || message.type() == MessageType::change ||
                     message.type() == MessageType::narrow_done;
  if (node && tests && message.header().epoch != state_.map.epoch()) {
    return;  // found before a loss was known; the node will find it again
  }
  if (node && !SharedNodes::is_shared(session) && !is_acceptable(session, message)) {
    return refuse(session, Status::bad_message);
  }
  switch (message.type()) {
    case MessageType::state_update:
      // Poses are final after a host's last state message: a later state would reach some nodes and not others.
      return node || session.received.states ? refuse(session, Status::bad_message) : receive_states(session, message);
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
      return node ? void(session.received.published = true) : refuse(session, Status::bad_message);
    case MessageType::probe_reply:
      return node ? void() : refuse(session, Status::bad_message);
    case MessageType::kinds:
      return node ? statistics_.add_kinds(message) : refuse(session, Status::bad_message);
    case MessageType::frame_done:
      // Accepted once, and only after the contacts that it acknowledges have been sent.
      return message.count() == 1 && !session.received.frame_done && state_.contacts_are_final() &&
                     session.closing.notice_run.done()
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
    if (state_.setup.quotas.updates != 0 && ++session.received.updates > state_.setup.quotas.updates) {
      refuse(session, Status::over_quota, record.object.number);
      continue;
    }
    const std::uint32_t slot = state_.objects.find(record.object);
    if (slot == base::NumberIndex::none) {
      refuse(session, Status::stale_object, record.object.number);
      continue;
    }
    ObjectRow& row = state_.objects.row(slot);
    if (state_.objects.host(slot) != session.self) {
      refuse(session, Status::not_host, record.object.number);
      continue;
    }
    if (const Status status = make_valid(record.pose); status != Status::ok) {
      refuse(session, status, record.object.number);
      continue;
    }
    row.pose = record.pose;
    row.object.flags = record.object.flags & messages::flag_present;
    state_.objects.bounds(slot) = state_.setup.shapes->bounds(row.shape, row.pose, *state_.setup.space);
    std::copy_n(message.state<messages::StateRecord>(i), state_.objects.state_bytes(), state_.objects.state(slot));
    state_.objects.mark_moved(slot);
  }
  session.received.states |= message.last();
  statistics_.add_ingest(telemetry::now_ns() - start);
}

void ServerRole::receive_node_states(PeerSession& session, const MessageView& message) {
  const std::uint64_t start = telemetry::now_ns();
  constexpr std::size_t ahead = 12;
  const bool sweeps = state_.setup.placement == Placement::server;
  const bool shares = SharedNodes::is_shared(session);
  ObjectTable& objects = state_.objects;
  const regions::CellGrid& grid = state_.map.grid();
  for (std::size_t i = 0; i < message.count(); ++i) {
    if (i + ahead < message.count()) {
      const auto& soon = message.view<messages::ObjectRef>(i + ahead);
      objects.prefetch(soon.slot, sweeps || (soon.flags & messages::flag_interior) == 0);
    }
    if (i + 2 * ahead < message.count()) {
      base::prefetch_for_read(message.at(i + 2 * ahead));
      base::prefetch_for_read(message.at(i + 2 * ahead) + 64);
    }
    const auto& record = message.view<messages::NodeStateRecord>(i);
    const std::uint32_t slot = objects.find(record.object);
    if (slot == base::NumberIndex::none || objects.host(slot) != session.self) {
      refuse(session, slot == base::NumberIndex::none ? Status::stale_object : Status::not_host, record.object.number);
      continue;
    }
    ObjectRow& row = objects.row(slot);
    row.pose = record.pose;
    row.object.flags = record.object.flags & messages::flag_present;
    // An object outside its own bounds may leave the only node that knows it; then the notified nodes must be recorded.
    constexpr std::uint32_t at_home = messages::flag_interior | messages::flag_keeps_host;
    const bool inner = (record.object.flags & at_home) == at_home;
    ObjectMarks& marks = objects.marks(slot);
    const bool was_host_owned = (marks & host_owned_mark) != 0;
    const bool host_owned = (record.object.flags & messages::flag_host_owned) != 0 && shares;
    marks = static_cast<ObjectMarks>((marks & ~host_owned_mark) | reported_mark | (inner ? inner_mark : 0) |
                                     (host_owned ? host_owned_mark : 0));
    // Counted as moved, but it has not.
    states_.add_moved((record.object.flags & messages::flag_at_rest) != 0 ? -1 : 0);
    if ((record.object.flags & messages::flag_keeps_host) == 0) {
      state_.leaving_slots.push_back(slot);
    }
    std::copy_n(message.state<messages::NodeStateRecord>(i), objects.state_bytes(), objects.state(slot));
    if (was_host_owned) {
      objects.note_notified(slot, record.bounds, grid, !inner);
      objects.mark_moved_host_only(slot);
      continue;
    }
    const bool host_alone = inner && (marks & shared_mark) == 0;  // only the host needs to know the object
    if (sweeps || !host_alone || shares) {
      objects.bounds(slot) = record.bounds;
    } else {
      states_.note_stale_bounds();  // saves a cache line per state; the bounds are computed from the pose when needed
    }
    if (host_alone) {
      marks |= notified_mark;
      objects.mark_moved_host_only(slot);
    } else {
      objects.mark_moved(slot);
    }
  }
  session.received.states |= message.last();
  statistics_.add_ingest(telemetry::now_ns() - start);
}

void ServerRole::receive_collisions(PeerSession& session, const MessageView& message) {
  constexpr std::size_t ahead = 8;  // 64,000 rows do not fit the second-level cache
  for (std::size_t i = 0; i < message.count(); ++i) {
    if (i + ahead < message.count()) {
      const auto& soon = message.view<messages::CollisionRecord>(i + ahead);
      base::prefetch_for_read(&state_.objects.row(soon.slot_a));
      base::prefetch_for_read(&state_.objects.row(soon.slot_b));
      base::prefetch_for_read(state_.objects.origins().data() + soon.slot_a);
      base::prefetch_for_read(state_.objects.origins().data() + soon.slot_b);
    }
    const auto& record = message.view<messages::CollisionRecord>(i);
    const bool present = state_.objects.present()[record.slot_a] != 0 && state_.objects.present()[record.slot_b] != 0;
    if (!present ||
        !state_.ledger.receive(session.self.number(), record, state_.objects.rows(), state_.objects.origins())) {
      return refuse(session, Status::bad_message);
    }
  }
}

void ServerRole::receive_changes(PeerSession& session, const MessageView& message) {
  for (std::size_t i = 0; i < message.count(); ++i) {
    if (!state_.ledger.receive(session.self.number(), message.record<messages::ChangeRecord>(i))) {
      return refuse(session, Status::bad_message);
    }
  }
}

// A node's results count only as a whole: when it reports the number of tested pairs, and all its contacts are here.
void ServerRole::receive_narrow_done(PeerSession& session, const MessageView& message) {
  const auto record = message.record<messages::NarrowDoneRecord>(0);
  statistics_.add(session, record);
  if (!shared_.receive_contacts(session, statistics_)) {
    state_.ledger.end_run(session.self.number());
  }
  if (state_.ledger.received(session.self.number()) == record.contacts) {
    state_.report().accepted += record.tested;
  } else {
    refuse(session, Status::bad_message);
  }
  session.received.narrow_done = true;
}

void ServerRole::receive_frame_done(PeerSession& session, const MessageView& message) {
  const auto record = message.record<messages::NodeFrameStats>(0);
  statistics_.add(session, record);
  if (session.self.is_node()) {
    session.cost_ms = MapScheduler::cost_of(state_.setup, state_.report().nodes[session.in_report]);
    states_.add_moved(static_cast<std::int64_t>(record.host_owned_changes));
  }
  session.received.frame_done = true;
}

}  // namespace ringfence::nodes
