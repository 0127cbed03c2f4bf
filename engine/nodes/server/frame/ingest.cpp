#include "nodes/server/frame/ingest.hpp"

#include <algorithm>

#include "base/prefetch.hpp"
#include "nodes/host/valid_pose.hpp"
#include "nodes/message_check.hpp"
#include "telemetry/clock.hpp"

namespace ringfence::nodes {

using messages::Endpoint;
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

bool Ingest::receive() {
  bool any = false;
  if (state_.setup.frame_control != nullptr) {
    any = receive_reports();
  } else {
    state_.all_nodes([&](PeerSession& node) {
      any |= is_awaited(node) && drain(node);
      return true;
    });
  }
  any |= receive_from_users();
  return any;
}

bool Ingest::receive_reports() {
  reports_.look();
  const bool any = receive_from_senders();
  return reports_.accept() || any;
}

// A session, the receiver and the message are on lines that this core has not had since the last step: three reads that
// depend on each other are prefetched in a pipeline.
bool Ingest::receive_from_senders() {
  constexpr std::size_t ahead = 4;
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
  for (std::size_t i = 0; i < senders_.size() + 3 * ahead; ++i) {
    if (const PeerSession* node = behind(i, 0)) {
      base::prefetch_for_read(&node->connection);
    }
    if (const PeerSession* node = behind(i, ahead)) {
      base::prefetch_for_write(node->connection.in);
    }
    if (const PeerSession* node = behind(i, 2 * ahead)) {
      node->connection.in->prefetch();
    }
    if (PeerSession* node = behind(i, 3 * ahead)) {
      any |= node->is_active() && drain(*node);
    }
  }
  return any;
}

bool Ingest::all_completed(ReportedStep step) {
  if (state_.setup.frame_control != nullptr && state_.report().lost.empty()) {
    return reports_.all(step);
  }
  return state_.all_nodes([&](PeerSession& node) { return has_completed(node.received, step); });
}

// Whether the frame waits for a message of the node.
bool Ingest::is_awaited(const PeerSession& node) const noexcept {
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

// While no message of the users is awaited, unexpected messages stay in the rings.
bool Ingest::receive_from_users() {
  bool any = false;
  for (UserConnection& peers : state_.user_connections) {
    any |= state_.awaits(peers) && drain(peers);
  }
  return any;
}

bool Ingest::drain(PeerSession& node) {
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
      refuse(node, Status::bad_message);
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

// Reads what the users of a connection have sent, up to a limit: a flooding thread must not keep the others waiting.
bool Ingest::drain(UserConnection& peers) {
  constexpr std::size_t max_bytes_at_once = 65536;
  if (!peers.connection.in->has_message()) {
    return false;
  }
  const std::uint64_t start = telemetry::now_ns();
  std::size_t taken = 0;
  while (taken < max_bytes_at_once) {
    const std::span<const std::byte> bytes = peers.connection.in->next();
    if (bytes.empty()) {
      break;
    }
    taken += bytes.size();
    receive_from_user(peers, bytes);
  }
  peers.connection.in->release();
  if (state_.stage <= FrameStage::moving) {
    statistics_.add_ingest(telemetry::now_ns() - start);
  }
  return true;
}

// A message that names no user of its connection counts as one of the first of them. What a late user sends is ignored.
void Ingest::receive_from_user(UserConnection& peers, std::span<const std::byte> bytes) {
  MessageView message;
  bool valid = messages::decode(bytes, state_.objects.state_bytes(), message) == Status::ok;
  const Endpoint source{valid ? message.header().source : Endpoint::none().value};
  if (source == Endpoint::all_users() && receive_from_all(peers, message)) {
    return;
  }
  const bool named = source.is_user() && source.number() < state_.users.size() &&
                     state_.users[source.number()].connected &&
                     state_.users[source.number()].connection.in == peers.connection.in;
  PeerSession& user = state_.users[named ? source.number() : peers.users.front()];
  if (user.lost) {
    return;
  }
  base::prefetch_object(state_.users[std::min<std::size_t>(user.self.number() + 8, state_.users.size() - 1)].received);
  PeerSession::Received& received = state_.received_from(user);
  const bool was_awaited = !received.states;
  valid = valid && named && message.header().frame == state_.frame;
  if (is_over_quota(user, bytes.size(), valid ? &message : nullptr)) {
    refuse(user, Status::over_quota);
  } else if (valid) {
    receive(user, message);
  } else {
    refuse(user, Status::bad_message);
  }
  state_.awaited_users -= was_awaited && received.states ? 1 : 0;
}

// What the thread of user nodes sends for all of them. Returns false if the protocol does not allow it now.
bool Ingest::receive_from_all(UserConnection& peers, const MessageView& message) {
  if (message.header().frame != state_.frame) {
    return false;
  }
  if (message.type() == MessageType::published && !peers.published && !state_.contacts_are_final()) {
    peers.published = true;
  } else if (message.type() == MessageType::frame_done && message.count() == 1 && !peers.frame_done &&
             state_.contacts_are_final() && peers.end_run.done()) {
    peers.frame_done = true;
    statistics_.add_users(message.record<messages::NodeFrameStats>(0));
  } else {
    return false;
  }
  statistics_.count(message.header());
  return true;
}

bool Ingest::refuse_lost() {
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

// Whether the message exceeds its sender's quota and is ignored. The end of the states counts nevertheless: otherwise
// the frame would wait for it.
bool Ingest::is_over_quota(PeerSession& user, std::size_t bytes, const MessageView* valid) {
  user.received.bytes += bytes;
  if (state_.setup.quotas.bytes == 0 || user.received.bytes <= state_.setup.quotas.bytes + 512 * shared_objects()) {
    return false;
  }
  user.received.states |= valid != nullptr && valid->type() == MessageType::state_update && valid->last();
  return true;
}

// Counts all refusals, and reports only the first ones: a user node that sends invalid messages must not make the
// server send as many. A CD node of another process that breaks the protocol becomes lost, because its contacts of the
// frame cannot be trusted.
void Ingest::refuse(PeerSession& sender, Status reason, ObjectNumber number) {
  state_.refuse(reason);
  if (sender.self.is_node() && !exchange_.trusts_nodes() && reason == Status::bad_message) {
    sender.broken = any_broken_ = true;
  }
  if (sender.self.is_user() && sender.received.refusals.size() < PeerSession::Received::max_refusals) {
    if (sender.received.refusals.empty()) {
      state_.refused_users.push_back(sender.self.number());
    }
    sender.received.refusals.push_back({number, static_cast<std::uint32_t>(reason)});
  }
}

// Whether a CD node of another process may send this message now, and its records are valid. States are final after the
// last one has arrived, and contacts after narrow_done: other roles read them from then on.
bool Ingest::is_acceptable(const PeerSession& node, const MessageView& message) const noexcept {
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

// Whether the protocol allows a message of this type from the sender now.
bool Ingest::may_send(const PeerSession& session, const MessageView& message) const noexcept {
  const bool node = session.self.is_node();
  switch (message.type()) {
    case MessageType::state_update:
      // Poses are final after a host's last state message: a later state would reach some nodes and not others.
      return !node && !session.received.states;
    case MessageType::node_state:
    case MessageType::replica:
    case MessageType::collision:
    case MessageType::change:
    case MessageType::probe_reply:
    case MessageType::kinds:
    case MessageType::query_hit:
    case MessageType::ghost_counts:
    case MessageType::contact_counts:
      return node;
    case MessageType::narrow_done:
      return node && message.count() == 1;
    case MessageType::frame_done:
      // Accepted once, and only after the contacts that it acknowledges have been sent. See receive_from_all().
      return node && message.count() == 1 && !session.received.frame_done && state_.contacts_are_final() &&
             session.closing.end_run.done();
    default:
      return false;
  }
}

void Ingest::receive(PeerSession& session, const MessageView& message) {
  statistics_.count(message.header());
  const bool node = session.self.is_node();
  if (node && belongs_to_map(message.type()) && message.header().epoch != state_.map.epoch()) {
    return;  // found before a loss was known; the node will find it again
  }
  const bool trusted = !node || exchange_.trusts_nodes();
  if (!may_send(session, message) || !(trusted || is_acceptable(session, message))) {
    return refuse(session, Status::bad_message);
  }
  switch (message.type()) {
    case MessageType::state_update:
      return receive_states(session, message);
    case MessageType::node_state:
      return receive_node_states(session, message);
    case MessageType::replica:
      return receive_replicas(session, message);
    case MessageType::collision:
      return receive_collisions(session, message);
    case MessageType::change:
      return receive_changes(session, message);
    case MessageType::narrow_done:
      return results_.add_tests(session, message.record<messages::NarrowDoneRecord>(0))
                 ? void()
                 : refuse(session, Status::bad_message);
    case MessageType::ghost_counts:
    case MessageType::contact_counts:
      return exchange_.receive_counts(session, message) ? void() : refuse(session, Status::bad_message);
    case MessageType::query_hit:
      return exchange_.receive_hits(session, message) ? void() : refuse(session, Status::bad_message);
    case MessageType::kinds:
      for (std::size_t i = 0; i < message.count(); ++i) {
        results_.add_kinds(std::span(&message.view<messages::KindRecord>(i), 1));
      }
      return;
    case MessageType::frame_done:
      return results_.finish(session, message.record<messages::NodeFrameStats>(0));
    default:
      return;  // a probe_reply has no content
  }
}

namespace {

/// Computes the bounds of changed objects, several at a time.
class BoundsBatch {
 public:
  explicit BoundsBatch(ServerState& state) : state_(state) {}

  void add(std::uint32_t slot, const ObjectRow& row) {
    if (count_ == capacity) {
      finish();
    }
    slots_[count_] = slot;
    placed_[count_++] = {&row.pose, row.shape};
  }
  /// After the last add().
  void finish() {
    state_.setup.shapes->bounds({placed_, count_}, *state_.setup.space, bounds_);
    for (std::size_t i = 0; i < count_; ++i) {
      state_.objects.bounds(slots_[i]) = bounds_[i];
    }
    count_ = 0;
  }

 private:
  static constexpr std::size_t capacity = 64;
  ServerState& state_;
  std::size_t count_ = 0;
  std::uint32_t slots_[capacity];
  geometry::PlacedShape placed_[capacity];
  geometry::Bounds bounds_[capacity];
};

}  // namespace

// M1. User nodes are not trusted: a state is accepted only if the user hosts the object and the pose is valid.
void Ingest::receive_states(PeerSession& session, const MessageView& message) {
  ObjectTable& objects = state_.objects;
  BoundsBatch bounds(state_);
  for (std::size_t i = 0; i < message.count(); ++i) {
    const auto& record = message.view<messages::StateRecord>(i);
    if (state_.setup.quotas.updates != 0 &&
        ++session.received.updates > state_.setup.quotas.updates + shared_objects()) {
      refuse(session, Status::over_quota, record.object.number);
      continue;
    }
    const std::uint32_t slot = objects.find(record.object);
    const Status status = slot == base::NumberIndex::none      ? Status::stale_object
                          : objects.host(slot) != session.self ? Status::not_host
                                                               : check_pose(record.pose);
    if (status != Status::ok) {
      refuse(session, status, record.object.number);
      continue;
    }
    ObjectRow& row = objects.change_row(slot);
    row.pose = record.pose;
    (void)make_valid(row.pose);  // normalises
    row.object.flags = record.object.flags & messages::flag_present;
    objects.set_jumped(slot, (record.object.flags & messages::flag_jumped) != 0);
    bounds.add(slot, row);
    std::copy_n(message.state<messages::StateRecord>(i), objects.state_bytes(), objects.new_state(slot));
    objects.mark_moved(slot);
  }
  bounds.finish();
  session.received.states |= message.last();
}

void Ingest::receive_node_states(PeerSession& session, const MessageView& message) {
  session.received.bytes += message.header().bytes;
  const std::uint64_t start = telemetry::now_ns();
  constexpr std::size_t ahead = 12;
  const bool sweeps = state_.setup.placement == Placement::server;
  const bool nodes_keep_states = states_.nodes_keep_states();
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
      state_.leaving_slots.push_back(slot);
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
  session.received.states |= message.last();
  statistics_.add_ingest(telemetry::now_ns() - start);
}

// The other nodes have received the object from its host.
void Ingest::receive_replicas(PeerSession& node, const MessageView& message) {
  const std::uint64_t start = telemetry::now_ns();
  constexpr std::size_t ahead = 12;
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
      return refuse(node, Status::bad_message);
    }
    objects.change_row(slot).pose = record.pose;
    objects.marks(slot) |= reported_mark;
    std::copy_n(message.state<messages::ReplicaRecord>(i), objects.state_bytes(), objects.new_state(slot));
    objects.mark_moved_host_only(slot);
  }
  states_.note_stale_bounds();
  statistics_.add_ingest(telemetry::now_ns() - start);
}

void Ingest::receive_collisions(PeerSession& session, const MessageView& message) {
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
        !state_.ledger.receive(session.self.number(), record, objects)) {
      return refuse(session, Status::bad_message);
    }
  }
}

void Ingest::receive_changes(PeerSession& session, const MessageView& message) {
  for (std::size_t i = 0; i < message.count(); ++i) {
    if (!state_.ledger.receive(session.self.number(), message.record<messages::ChangeRecord>(i))) {
      return refuse(session, Status::bad_message);
    }
  }
}

}  // namespace ringfence::nodes
