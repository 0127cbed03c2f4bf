// The server's cut: requests become objects, users and hosts, and every host is told before its frame begins.
#include <algorithm>
#include <cstring>
#include <utility>

#include "nodes/server_role.hpp"
#include "telemetry/clock.hpp"

namespace ringfence::nodes {

using messages::Endpoint;
using messages::MessageType;

void ServerRole::cut() {
  frame_ = frames_++;
  begin_ns_ = mark_ns_ = telemetry::now_ns();
  cpu_begin_ns_ = cpu_mark_ns_ = telemetry::thread_cpu_ns();
  ingest_ns_ = 0;
  close_ranks();
  retire_nodes();
  objects_.settle();
  users_changed_ = false;
  start_report();
  apply_requests();
  restore_objects();
  const auto changes = hosting_.settle(objects_, map_, connected_, users_changed_);
  for (const Rehosting& change : changes) {
    rehost(change);
  }
  tell_late_contacts(changes);
  report().nodes.resize(nodes_.size());
  order_relay();
  leaving_.clear();
  ledger_.begin(frame_);
  host_.begin_contacts(frame_);
  all_nodes([&](Party& node) {
    start(node);
    return true;
  });
  hand_overs_.clear();
  kept_moved_ = 0;
  losses_to_tell_ = relays_listed_ = false;
  stage_ = Stage::opening;
}

// What is to be sent before the frame, and what is to be heard in it.
void ServerRole::start(Party& party) {
  party.drop_run.start(party.drops.size());
  party.adopt_run.start(party.adoptions.size());
  party.place_run.start(party.placements.size());
  party.late_run.start(party.late_contacts.size());
  party.refusals.swap(party.new_refusals);
  party.new_refusals.clear();
  party.refused_run.start(party.refusals.size());
  party.begin_run.start(0);
  if (map_first_) {
    party.new_map_run.start(map_.table().size());
  }
  party.hand_overs = 0;
  party.states_heard = party.published_heard = party.tested_heard = party.told_heard = false;
  party.heard_bytes = party.heard_updates = 0;
  party.heard_ns = begin_ns_;
  party.probed_ns = party.opened_ns = party.notified_ns = 0;
  party.notices.clear();
}

// While the nodes move.
void ServerRole::start_users() {
  awaited_users_.clear();
  all_users([&](Party& user) {
    start(user);
    awaited_users_.push_back(user.self.number());
    return true;
  });
}

// In the order of the calls, but for spawns that follow each other: those fill the tables in the order of their places.
void ServerRole::apply_requests() {
  constexpr std::size_t ahead = 8;  // what is placed lies anywhere
  const std::span<const Request> requests = setup_.order->requests;
  for (std::size_t begin = 0; begin < requests.size();) {
    std::size_t end = begin;
    while (end < requests.size() && requests[end].kind == Request::Kind::spawn) {
      ++end;
    }
    if (end - begin > 1) {
      const auto spawns = requests.subspan(begin, end - begin);
      for (const PlacedSpawn& placed : order_by_place(spawns, *setup_.space, spawn_order_)) {
        spawn(spawns[placed.position]);
      }
      begin = end;
    } else {
      if (begin + ahead < requests.size()) {
        objects_.fetch(objects_.find(requests[begin + ahead].object.number()));
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
      nodes_[request.nodes].leaving = true;
      return;
    case Request::Kind::resize:
      resize_to_ = request.nodes;
      return;
    case Request::Kind::destroy:
    case Request::Kind::place:
    case Request::Kind::remove:
      break;
  }
  const std::uint32_t slot = objects_.find(request.object.number());
  if (slot == NumberIndex::none || objects_.row(slot).object.generation != request.object.generation()) {
    return;
  }
  if (request.kind == Request::Kind::destroy) {
    end_object(slot);
  } else if (request.kind == Request::Kind::place) {
    place(slot, request.spec.pose, true);
  } else {
    place(slot, pose(slot), false);
  }
}

void ServerRole::connect(const Request& request) {
  if (request.user >= users_.size()) {
    users_.resize(request.user + 1);
  }
  Party& party = users_[request.user];
  party = {};
  party.self = Endpoint::user(request.user);
  party.line = request.line;
  party.connected = true;
  connected_.insert(std::lower_bound(connected_.begin(), connected_.end(), request.user), request.user);
  users_changed_ = true;
}

// A new node works from its first frame on, though its region is empty until the map changes at the frame's end.
void ServerRole::add_node(const Request& request) {
  Party& party = nodes_.emplace_back();
  party.self = Endpoint::node(static_cast<NodeNumber>(nodes_.size() - 1));
  party.line = request.line;
  party.connected = true;
  node_lines_.push_back(request.line);
  dispatch_.resize(nodes_.size());
  ledger_.resize(nodes_.size());
}

// Nodes that the map no longer knows handed everything over at the end of the frame before.
void ServerRole::retire_nodes() {
  if (nodes_.size() > map_.nodes()) {
    nodes_.resize(map_.nodes());
    node_lines_.resize(map_.nodes());
    dispatch_.resize(map_.nodes());
    ledger_.resize(map_.nodes());
  }
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
  objects_.bounds(slot) = setup_.shapes->bounds(request.spec.shape, request.spec.pose, *setup_.space);
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
  let_go(slot);
  const Endpoint host = objects_.host(slot);
  if (Party* party = party_of(host)) {
    party->drops.push_back(slot);
  } else if (host.is_server()) {
    host_.drop(objects_.row(slot).object.number);
  }
  objects_.end(slot);
}

// From now on the server tells the nodes of it. The host, if it goes on, forgets that it keeps the object to itself
// when it is told where to place it.
void ServerRole::let_go(std::uint32_t slot) {
  if ((objects_.marks(slot) & kept_mark) == 0) {
    return;
  }
  const Host& host = *nodes_[objects_.host(slot).number()].line.findings->host;
  const std::uint32_t at = host.find(objects_.row(slot).object.number);
  ObjectRow& row = objects_.row(slot);
  row.pose = host[at].pose;
  std::copy_n(host.state(at), objects_.state_bytes(), objects_.state(slot));
  objects_.marks(slot) = static_cast<ObjectMarks>(objects_.marks(slot) & ~kept_mark);
  note_told(slot, setup_.shapes->bounds(row.shape, row.pose, *setup_.space), true);
}

void ServerRole::place(std::uint32_t slot, const Pose& pose, bool present) {
  let_go(slot);
  ObjectRow& row = objects_.row(slot);
  row.pose = pose;
  row.object.flags = present ? messages::flag_present : 0u;
  objects_.mark_moved(slot);
  const Endpoint host = objects_.host(slot);
  if (host.is_server() && host_.place(row.object.number, pose, present)) {
    return;  // the bounds follow when it has moved
  }
  objects_.bounds(slot) = setup_.shapes->bounds(row.shape, pose, *setup_.space);
  if (Party* party = party_of(host)) {
    party->placements.push_back(slot);
  }
}

void ServerRole::rehost(const Rehosting& change) {
  const ObjectRow& row = objects_.row(change.slot);
  if (Party* from = party_of(change.from)) {
    from->drops.push_back(change.slot);
  } else if (change.from.is_server()) {
    host_.drop(row.object.number);
    // It may have been placed at this cut, and the next host reports only what it moves.
    objects_.bounds(change.slot) = setup_.shapes->bounds(row.shape, row.pose, *setup_.space);
  }
  if (Party* to = party_of(change.to)) {
    to->adoptions.push_back(change.slot);
  } else if (change.to.is_server()) {
    host_.adopt(objects_.hand_over(change.slot), objects_.state(change.slot));
  }
  if (change.from != Endpoint::none()) {
    ++report().handed_over;
    objects_.marks(change.slot) |= rehosted_mark;
  }
}

// The new hosts answer the contacts of the frame before, so they must know them. Rare: users came or went. One pass
// over the contacts, however many objects changed hosts.
void ServerRole::tell_late_contacts(std::span<const Rehosting> changes) {
  const auto changed = [&](std::uint32_t slot) { return (objects_.marks(slot) & rehosted_mark) != 0; };
  if (std::none_of(changes.begin(), changes.end(), [&](const Rehosting& change) { return changed(change.slot); })) {
    return;
  }
  const auto contacts = ledger_.contacts(frame_ - 1);
  const auto found = ledger_.found(frame_ - 1);
  const auto tell = [&](Endpoint host, const Contact& contact) {
    if (Party* party = party_of(host)) {
      party->late_contacts.push_back(contact);
    } else if (host.is_server()) {
      host_.add_late_contact(contact);
    }
  };
  for (std::size_t i = 0; i < found.size(); ++i) {
    const bool a = changed(found[i].a);
    const bool b = changed(found[i].b);
    if (a) {
      tell(objects_.host(found[i].a), contacts[i]);
    }
    if (b && !(a && objects_.host(found[i].a) == objects_.host(found[i].b))) {
      tell(objects_.host(found[i].b), contacts[i]);
    }
  }
  for (const Rehosting& change : changes) {
    objects_.marks(change.slot) &= static_cast<ObjectMarks>(~rehosted_mark);
  }
}

Party* ServerRole::party_of(Endpoint endpoint) noexcept {
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

// Orders first, then the word to begin: whoever hears it knows what it hosts.
bool ServerRole::open(Party& party) {
  link::Sender& out = *party.line.out;
  auto& counts = report().traffic;
  const std::size_t state_bytes = objects_.state_bytes();
  const auto send = [&](messages::RunSender& run, auto& list, MessageType type, auto fill) {
    if (list.empty()) {
      return true;
    }
    if (!run.pump(out, head(type, party.self), messages::record_bytes(type, state_bytes), counts, fill)) {
      return false;
    }
    list.clear();
    return true;
  };
  const bool told = !map_first_ || party.self.is_user() || send_map(party, party.new_map_run);
  const bool sent =
      told &&
      send(party.drop_run, party.drops, MessageType::drop,
           [&](std::size_t i, std::byte* where) {
             const messages::DropRecord record{objects_.row(party.drops[i]).object};
             std::memcpy(where, &record, sizeof record);
           }) &&
      send(party.adopt_run, party.adoptions, MessageType::adopt,
           [&](std::size_t i, std::byte* where) {
             const std::uint32_t slot = party.adoptions[i];
             const messages::HandOverRecord record = objects_.hand_over(slot);
             std::memcpy(where, &record, sizeof record);
             std::copy_n(objects_.state(slot), state_bytes, where + sizeof record);
           }) &&
      send(party.place_run, party.placements, MessageType::place,
           [&](std::size_t i, std::byte* where) {
             const ObjectRow& row = objects_.row(party.placements[i]);
             const messages::PlaceRecord record{row.object, row.pose};
             std::memcpy(where, &record, sizeof record);
           }) &&
      send(party.late_run, party.late_contacts, MessageType::notify,
           [&](std::size_t i, std::byte* where) { std::memcpy(where, &party.late_contacts[i], sizeof(Contact)); }) &&
      send(party.refused_run, party.refusals, MessageType::refused, [&](std::size_t i, std::byte* where) {
        std::memcpy(where, &party.refusals[i], sizeof(messages::RefusedRecord));
      });
  return sent && party.begin_run.pump(out, head(MessageType::frame_begin, party.self), 0, counts,
                                      [](std::size_t, std::byte*) {});
}

}  // namespace ringfence::nodes
