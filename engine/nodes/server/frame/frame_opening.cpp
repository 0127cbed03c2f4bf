#include "nodes/server/frame/frame_opening.hpp"

#include <algorithm>
#include <cstring>

#include "base/release_memory.hpp"

namespace ringfence::nodes {

using messages::MessageType;

void FrameOpening::start_nodes() {
  const auto prefetch = [](const PeerSession& node) { node.prefetch_frame(); };
  state_.all_nodes(prefetch, [&](PeerSession& node) {
    start(node);
    return true;
  });
}

// Nothing is written for a user without changes: of many users none is in a cache.
void FrameOpening::start_users() {
  for (const UserNumber user : state_.refused_users) {
    PeerSession& session = state_.users[user];
    state_.opening_of(session.self)->refusals.swap(session.received.refusals);
    session.received.refusals.clear();
  }
  state_.refused_users.clear();
  for (UserConnection& peers : state_.user_connections) {
    std::sort(peers.changed.begin(), peers.changed.end());
    for (const UserNumber user : peers.changed) {
      start_runs(state_.users[user].opening);
    }
    peers.next = 0;
    peers.begin_run.start(0);
    peers.end_run.start(0);
    peers.published = peers.frame_done = false;
  }
  state_.await_users();
}

bool FrameOpening::open_users() {
  bool all = true;
  for (UserConnection& peers : state_.user_connections) {
    all &= state_.send_to_users(peers, peers.changed, [this](PeerSession& user) { return send_changes(user); }) &&
           state_.send_to_all(peers, peers.begin_run, MessageType::frame_begin);
  }
  if (all) {
    forget_changes();
  }
  return all;
}

void FrameOpening::forget_changes() noexcept {
  for (UserConnection& peers : state_.user_connections) {
    for (const UserNumber user : peers.changed) {
      state_.users[user].changes = false;
    }
    peers.changed.clear();
  }
}

void FrameOpening::start_runs(PeerSession::Opening& opening) noexcept {
  opening.drop_run.start(opening.drops.size());
  opening.adopt_run.start(opening.adoptions.size());
  opening.place_run.start(opening.placements.size());
  opening.contact_run.start(opening.contacts.size());
  opening.refused_run.start(opening.refusals.size());
}

void FrameOpening::start(PeerSession& node) {
  if (node.changes) {
    start_runs(node.opening);
  }
  exchange_.start_run(node.begin_run, MessageType::frame_begin, 0);
  if (state_.map_change.precedes_frame) {
    node.loss.map_run.start(state_.map.table().size());
  }
  node.hand_overs = 0;
  node.received.begin(state_.frame);
  node.last_received_ns = state_.begin_ns;
  node.probed_ns = node.started.ns = node.dispatched.ns = node.notified.ns = 0;
}

bool FrameOpening::open(PeerSession& node) {
  if (state_.map_change.precedes_frame && !exchange_.send_map(node, node.loss.map_run)) {
    return false;
  }
  if (node.changes && !send_changes(node)) {
    return false;
  }
  node.changes = false;
  return state_.send_empty(node, node.begin_run, MessageType::frame_begin);
}

bool FrameOpening::send_changes(PeerSession& session) {
  PeerSession::Opening& opening = session.opening;
  const ObjectTable& objects = state_.objects;
  const std::size_t state_bytes = objects.state_bytes();
  const auto send = [&](messages::RunSender& run, auto& list, MessageType type, auto write) {
    if (list.empty()) {
      return true;
    }
    if (!run.pump(*session.connection.out, state_.head(type, session.self), messages::record_bytes(type, state_bytes),
                  state_.report().traffic, [&](std::size_t i, std::byte* where) { write(list[i], where); })) {
      return false;
    }
    list.clear();
    return true;
  };
  const auto copy = [](const auto& record, std::byte* where) { std::memcpy(where, &record, sizeof record); };
  const auto write_drop = [&](std::uint32_t slot, std::byte* where) {
    copy(messages::DropRecord{objects.row(slot).object}, where);
  };
  const auto write_adoption = [&](std::uint32_t slot, std::byte* where) {
    copy(objects.hand_over(slot), where);
    std::copy_n(objects.state(slot), state_bytes, where + sizeof(messages::HandOverRecord));
  };
  const auto write_placement = [&](std::uint32_t slot, std::byte* where) {
    copy(messages::PlaceRecord{objects.row(slot).object, objects.row(slot).pose}, where);
  };
  const auto send_adoptions = [&] {
    const bool sent = send(opening.adopt_run, opening.adoptions, MessageType::adopt, write_adoption);
    if (sent) {
      base::clear_and_release(opening.adoptions);
    }
    return sent;
  };
  return send(opening.drop_run, opening.drops, MessageType::drop, write_drop) && send_adoptions() &&
         send(opening.place_run, opening.placements, MessageType::place, write_placement) &&
         send(opening.contact_run, opening.contacts, MessageType::notify, copy) &&
         send(opening.refused_run, opening.refusals, MessageType::refused, copy);
}

}  // namespace ringfence::nodes
