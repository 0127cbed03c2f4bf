#include "nodes/server/frame/user_ingest.hpp"

#include <algorithm>

#include "base/prefetch.hpp"
#include "nodes/host/valid_pose.hpp"
#include "telemetry/clock.hpp"

namespace ringfence::nodes {

using messages::Endpoint;
using messages::MessageType;
using messages::MessageView;

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

// While no message of the users is awaited, unexpected messages stay in the rings.
bool UserIngest::receive() {
  bool any = false;
  for (UserConnection& peers : state_.user_connections) {
    any |= state_.awaits(peers) && drain(peers);
  }
  return any;
}

// Reads what the users of a connection have sent, up to a limit: a flooding thread must not keep the others waiting.
bool UserIngest::drain(UserConnection& peers) {
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
void UserIngest::receive_from_user(UserConnection& peers, std::span<const std::byte> bytes) {
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
bool UserIngest::receive_from_all(UserConnection& peers, const MessageView& message) {
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

// Whether the message exceeds its sender's quota and is ignored. The end of the states counts nevertheless: otherwise
// the frame would wait for it.
bool UserIngest::is_over_quota(PeerSession& user, std::size_t bytes, const MessageView* valid) {
  user.received.bytes += bytes;
  if (state_.setup.quotas.bytes == 0 || user.received.bytes <= state_.setup.quotas.bytes + 512 * shared_objects()) {
    return false;
  }
  user.received.states |= valid != nullptr && valid->type() == MessageType::state_update && valid->last();
  return true;
}

// Counts all refusals, and reports only the first ones: a user node that sends invalid messages must not make the
// server send as many.
void UserIngest::refuse(PeerSession& user, Status reason, ObjectNumber number) {
  state_.refuse(reason);
  if (user.received.refusals.size() < PeerSession::Received::max_refusals) {
    if (user.received.refusals.empty()) {
      state_.refused_users.push_back(user.self.number());
    }
    user.received.refusals.push_back({number, static_cast<std::uint32_t>(reason)});
  }
}

// Poses are final after a user's last state message: a later state would reach some nodes and not others.
void UserIngest::receive(PeerSession& user, const MessageView& message) {
  statistics_.count(message.header());
  if (message.type() != MessageType::state_update || user.received.states) {
    return refuse(user, Status::bad_message);
  }
  receive_states(user, message);
}

// M1. User nodes are not trusted: a state is accepted only if the user hosts the object and the pose is valid.
void UserIngest::receive_states(PeerSession& user, const MessageView& message) {
  ObjectTable& objects = state_.objects;
  BoundsBatch bounds(state_);
  for (std::size_t i = 0; i < message.count(); ++i) {
    const auto& record = message.view<messages::StateRecord>(i);
    if (state_.setup.quotas.updates != 0 && ++user.received.updates > state_.setup.quotas.updates + shared_objects()) {
      refuse(user, Status::over_quota, record.object.number);
      continue;
    }
    const std::uint32_t slot = objects.find(record.object);
    const Status status = slot == base::NumberIndex::none   ? Status::stale_object
                          : objects.host(slot) != user.self ? Status::not_host
                                                            : check_pose(record.pose);
    if (status != Status::ok) {
      refuse(user, status, record.object.number);
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
  user.received.states |= message.last();
}

}  // namespace ringfence::nodes
