// The server's cut: applies the requests, assigns hosts, and sends every host its changes before its frame begins.
#include <algorithm>
#include <cstring>
#include <utility>

#include "nodes/server/server_role.hpp"
#include "telemetry/clock.hpp"

namespace ringfence::nodes {

using messages::Endpoint;
using messages::MessageType;

void ServerRole::cut() {
  frame_ = frames_++;
  begin_ns_ = mark_ns_ = telemetry::now_ns();
  cpu_begin_ns_ = cpu_mark_ns_ = telemetry::thread_cpu_ns();
  ingest_ns_ = 0;
  const bool any_lost = free_slots();
  objects_.settle();
  users_changed_ = false;
  start_report();
  apply_requests();
  if (any_lost) {
    replace_lost_nodes();
  }
  list_nodes();
  rehost_recovered();
  for (const HostChange& change : hosting_.settle(objects_, map_, connected_, users_changed_)) {
    rehost(change);
  }
  send_known_contacts();
  order_relay();
  leaving_slots_.clear();
  ledger_.begin(frame_);
  host_.read_contacts(ledger_.contacts(frame_ - 1), ledger_.keys(frame_ - 1));
  all_nodes([&](PeerSession& node) {
    start(node);
    return true;
  });
  hand_overs_.clear();
  host_owned_moved_ = 0;
  losses_pending_ = relays_are_final_ = nodes_abandoned_ = false;
  gates_watched_ns_ = 0;
  stage_ = Stage::starting_nodes;
}

// Prepares the messages to send before the frame, and resets what is received in it.
void ServerRole::start(PeerSession& session) {
  session.drop_run.start(session.drops.size());
  session.adopt_run.start(session.adoptions.size());
  session.place_run.start(session.placements.size());
  session.late_run.start(session.late_contacts.size());
  session.refusals.swap(session.new_refusals);
  session.new_refusals.clear();
  session.refused_run.start(session.refusals.size());
  session.begin_run.start(0);
  if (map_precedes_frame_) {
    session.new_map_run.start(map_.table().size());
  }
  session.hand_overs = 0;
  session.states_received = session.published_received = session.narrow_done_received = session.frame_done_received =
      false;
  session.received_bytes = session.received_updates = 0;
  session.last_received_ns = begin_ns_;
  session.probed_ns = session.started_ns = session.notified_ns = 0;
  session.notices.clear();
}

// Called while the nodes move.
void ServerRole::start_users() {
  awaited_users_.clear();
  if (setup_.user_deadline_ns != 0) {
    moves_watched_ns_ = telemetry::now_ns();
  }
  all_users([&](PeerSession& user) {
    start(user);
    awaited_users_.push_back(user.self.number());
    return true;
  });
}

// In the order of the calls, except for consecutive spawns: those fill the tables in the order of their positions.
void ServerRole::apply_requests() {
  constexpr std::size_t ahead = 8;  // placed objects are at random slots
  const std::span<const Request> requests = setup_.order->requests;
  for (std::size_t begin = 0; begin < requests.size();) {
    std::size_t end = begin;
    while (end < requests.size() && requests[end].kind == Request::Kind::spawn) {
      ++end;
    }
    if (end - begin > 1) {
      const auto spawns = requests.subspan(begin, end - begin);
      for (const PositionedSpawn& placed : order_by_position(spawns, *setup_.space, spawn_order_)) {
        spawn(spawns[placed.position]);
      }
      begin = end;
    } else {
      if (begin + ahead < requests.size()) {
        objects_.prefetch(objects_.find(requests[begin + ahead].object.number()));
      }
      apply(requests[begin]);
      ++begin;
    }
  }
  objects_.order_moved();
}

void ServerRole::apply(const Request& request) {
  switch (request.kind) {
    case Request::Kind::connect:
      return connect(request);
    case Request::Kind::disconnect:
      return disconnect(request.user);
    case Request::Kind::spawn:
      return spawn(request);
    case Request::Kind::add_node:
      return add_node(request);
    case Request::Kind::retire_node:
      nodes_[request.node].leaving = true;
      return;
    case Request::Kind::partition:
      partition_due_ = true;
      return;
    case Request::Kind::destroy:
    case Request::Kind::place:
    case Request::Kind::set_enabled:
      break;
  }
  const std::uint32_t slot = objects_.find(request.object.number());
  if (slot == base::NumberIndex::none || objects_.row(slot).object.generation != request.object.generation()) {
    return;
  }
  if (request.kind == Request::Kind::destroy) {
    end_object(slot);
  } else if (request.kind == Request::Kind::place) {
    place(slot, request.spec.pose, true);
  } else {
    place(slot, pose(slot), request.spec.enabled);
  }
}

void ServerRole::connect(const Request& request) {
  if (request.user >= users_.size()) {
    users_.resize(request.user + 1);
  }
  PeerSession& session = users_[request.user];
  session = {};
  session.self = Endpoint::user(request.user);
  session.connection = request.connection;
  session.connected = true;
  connected_.insert(std::lower_bound(connected_.begin(), connected_.end(), request.user), request.user);
  users_changed_ = true;
}

// Returns whether a node was lost in the frame before.
bool ServerRole::free_slots() {
  bool any_lost = false;
  for (PeerSession& session : nodes_) {
    if (session.lost || session.left) {
      any_lost |= session.lost;
      node_connections_[session.self.number()] = {};
      session = {};
    }
  }
  std::size_t slots = nodes_.size();
  while (slots > 0 && !nodes_[slots - 1].connected) {
    --slots;
  }
  set_slots(slots);
  return any_lost;
}

void ServerRole::set_slots(std::size_t slots) {
  nodes_.resize(slots);
  node_connections_.resize(slots);
  dispatch_.resize(slots);
  ledger_.resize(slots);
}

// A new node works from its first frame on, though its region is empty until the map changes at the end of that frame.
void ServerRole::add_node(const Request& request) {
  set_slots(std::max<std::size_t>(nodes_.size(), request.node + 1));
  PeerSession& session = nodes_[request.node];
  session.self = Endpoint::node(request.node);
  session.id = request.node_id;
  session.connection = request.connection;
  session.connected = true;
  node_connections_[request.node] = request.connection;
  ledger_.join(request.node, frame_);
}

void ServerRole::disconnect(UserNumber user) {
  for (std::uint32_t slot = 0; slot < objects_.slots(); ++slot) {
    if (objects_.alive(slot) && objects_.origin(slot).user == user) {
      end_object(slot);
    }
  }
  users_[user].connected = false;
  connected_.erase(std::lower_bound(connected_.begin(), connected_.end(), user));
  users_changed_ = true;
}

void ServerRole::spawn(const Request& request) {
  const std::uint32_t slot = objects_.add(request.object, request.spec);
  objects_.bounds(slot) = setup_.shapes->bounds(request.spec.shape.number(), request.spec.pose, *setup_.space);
  if (setup_.model == nullptr) {
    return;
  }
  try {
    setup_.model->start(request.spec, objects_.state(slot));
  } catch (...) {
    std::fill_n(objects_.state(slot), objects_.state_bytes(), std::byte{0});
    refuse(Status::model_failed);
  }
}

void ServerRole::end_object(std::uint32_t slot) {
  release_from_host(slot);
  const Endpoint host = objects_.host(slot);
  if (PeerSession* session = session_of(host)) {
    session->drops.push_back(slot);
  } else if (host.is_server()) {
    host_.drop(objects_.row(slot).object.number);
  }
  objects_.end(slot);
}

// From now on the server sends updates of the object. If its host goes on, the place message clears the host-owned flag
// there.
void ServerRole::release_from_host(std::uint32_t slot) {
  if ((objects_.marks(slot) & host_owned_mark) == 0) {
    return;
  }
  const Host& host = *nodes_[objects_.host(slot).number()].connection.node_contacts->host;
  const std::uint32_t at = host.find(objects_.row(slot).object.number);
  ObjectRow& row = objects_.row(slot);
  row.pose = host[at].pose;
  std::copy_n(host.state(at), objects_.state_bytes(), objects_.state(slot));
  objects_.marks(slot) = static_cast<ObjectMarks>(objects_.marks(slot) & ~host_owned_mark);
  note_notified(slot, setup_.shapes->bounds(row.shape, row.pose, *setup_.space), true);
}

void ServerRole::place(std::uint32_t slot, const Pose& pose, bool present) {
  release_from_host(slot);
  ObjectRow& row = objects_.row(slot);
  row.pose = pose;
  row.object.flags = present ? messages::flag_present : 0u;
  objects_.mark_moved(slot);
  const Endpoint host = objects_.host(slot);
  if (host.is_server() && host_.place(row.object.number, pose, present)) {
    return;  // the bounds are set when it has moved
  }
  objects_.bounds(slot) = setup_.shapes->bounds(row.shape, pose, *setup_.space);
  if (PeerSession* session = session_of(host)) {
    session->placements.push_back(slot);
  }
}

void ServerRole::rehost(const HostChange& change) {
  const ObjectRow& row = objects_.row(change.slot);
  if (PeerSession* from = session_of(change.from)) {
    from->drops.push_back(change.slot);
  } else if (change.from.is_server()) {
    host_.drop(row.object.number);
    // The object may have been placed at this cut, and the next host reports only objects that it moves.
    objects_.bounds(change.slot) = setup_.shapes->bounds(row.shape, row.pose, *setup_.space);
  }
  if (PeerSession* to = session_of(change.to)) {
    to->adoptions.push_back(change.slot);
  } else if (change.to.is_server()) {
    host_.adopt(objects_.hand_over(change.slot), objects_.state(change.slot));
  }
  if (change.from != Endpoint::none()) {
    ++report().handed_over;
    note_host_change(change.slot);
  }
}

void ServerRole::note_host_change(std::uint32_t slot) {
  objects_.marks(slot) |= host_changed_mark;
  host_changes_.push_back(slot);
}

// New hosts need the contacts of the frame before. Rare: users came or left, the map has changed, or a node was lost.
// One pass over the contacts, however many objects changed hosts. The server reads the output lists when it moves its
// own.
void ServerRole::send_known_contacts() {
  if (host_changes_.empty()) {
    return;
  }
  const auto changed = [&](std::uint32_t slot) { return (objects_.marks(slot) & host_changed_mark) != 0; };
  const auto send = [&](Endpoint host, const Contact& contact) {
    if (PeerSession* session = session_of(host)) {
      session->late_contacts.push_back(contact);
    }
  };
  const auto contacts = ledger_.contacts(frame_ - 1);
  const auto found = ledger_.found(frame_ - 1);
  for (std::size_t i = 0; i < found.size(); ++i) {
    const Endpoint first = objects_.host(found[i].a);
    const Endpoint second = objects_.host(found[i].b);
    const bool to_first = changed(found[i].a);
    if (to_first) {
      send(first, contacts[i]);
    }
    if (changed(found[i].b) && !(to_first && first == second)) {
      send(second, contacts[i]);
    }
  }
  for (const std::uint32_t slot : host_changes_) {
    objects_.marks(slot) &= static_cast<ObjectMarks>(~host_changed_mark);
  }
  host_changes_.clear();
}

PeerSession* ServerRole::session_of(Endpoint endpoint) noexcept {
  if (endpoint == Endpoint::none()) {
    return nullptr;
  }
  if (endpoint.is_node()) {
    return &nodes_[endpoint.number()];
  }
  if (endpoint.is_user() && users_[endpoint.number()].connected) {
    return &users_[endpoint.number()];
  }
  return nullptr;
}

// Changes first, then frame_begin: a host that receives it knows what it hosts.
bool ServerRole::open(PeerSession& session) {
  link::Sender& out = *session.connection.out;
  auto& counts = report().traffic;
  const std::size_t state_bytes = objects_.state_bytes();
  const auto send = [&](messages::RunSender& run, auto& list, MessageType type, auto fill) {
    if (list.empty()) {
      return true;
    }
    if (!run.pump(out, head(type, session.self), messages::record_bytes(type, state_bytes), counts, fill)) {
      return false;
    }
    list.clear();
    return true;
  };
  const bool map_sent = !map_precedes_frame_ || session.self.is_user() || send_map(session, session.new_map_run);
  const bool sent =
      map_sent &&
      send(session.drop_run, session.drops, MessageType::drop,
           [&](std::size_t i, std::byte* where) {
             const messages::DropRecord record{objects_.row(session.drops[i]).object};
             std::memcpy(where, &record, sizeof record);
           }) &&
      send(session.adopt_run, session.adoptions, MessageType::adopt,
           [&](std::size_t i, std::byte* where) {
             const std::uint32_t slot = session.adoptions[i];
             const messages::HandOverRecord record = objects_.hand_over(slot);
             std::memcpy(where, &record, sizeof record);
             std::copy_n(objects_.state(slot), state_bytes, where + sizeof record);
           }) &&
      send(session.place_run, session.placements, MessageType::place,
           [&](std::size_t i, std::byte* where) {
             const ObjectRow& row = objects_.row(session.placements[i]);
             const messages::PlaceRecord record{row.object, row.pose};
             std::memcpy(where, &record, sizeof record);
           }) &&
      send(session.late_run, session.late_contacts, MessageType::notify,
           [&](std::size_t i, std::byte* where) { std::memcpy(where, &session.late_contacts[i], sizeof(Contact)); }) &&
      send(session.refused_run, session.refusals, MessageType::refused, [&](std::size_t i, std::byte* where) {
        std::memcpy(where, &session.refusals[i], sizeof(messages::RefusedRecord));
      });
  return sent && session.begin_run.pump(out, head(MessageType::frame_begin, session.self), 0, counts,
                                        [](std::size_t, std::byte*) {});
}

}  // namespace ringfence::nodes
