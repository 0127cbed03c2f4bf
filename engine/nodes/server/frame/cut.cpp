#include "nodes/server/frame/cut.hpp"

#include <algorithm>
#include <utility>

#include "base/release_memory.hpp"

namespace ringfence::nodes {

using messages::Endpoint;

Cut::Cut(ServerState& state, ServerExchange& exchange, ObjectStates& states, MapScheduler& scheduler,
         Dispatch& dispatch)
    : state_(state),
      exchange_(exchange),
      states_(states),
      scheduler_(scheduler),
      dispatch_(dispatch),
      hosting_(state.setup.deployment, *state.setup.space),
      crowds_(state.setup.quotas.colliding_avatars) {}

bool Cut::begin() {
  state_.objects.settle();
  if (std::exchange(spawned_many_, false)) {
    states_.release();
  }
  state_.state_senders = 0;
  state_.leaving.clear();
  state_.hand_overs.clear();
  users_changed_ = false;
  bool any_lost = false;
  for (PeerSession& session : state_.nodes) {
    if (session.lost || session.left) {
      any_lost |= session.lost;
      exchange_.dismiss(session);
      session = {};
    }
  }
  std::size_t slots = state_.nodes.size();
  while (slots > 0 && !state_.nodes[slots - 1].connected) {
    --slots;
  }
  set_slots(slots);
  if (restored_) {
    mark_restored();
  }
  return any_lost;
}

void Cut::restore(std::span<const RestoredObject> objects, std::size_t state_bytes) {
  for (const PositionedSpawn& placed : order_by_position(objects, *state_.setup.space, spawn_order_)) {
    const RestoredObject& object = objects[placed.position];
    const std::uint32_t slot = state_.objects.add(object.id, object.spec);
    states_.set_bounds(slot);
    std::copy_n(object.state, state_bytes, state_.objects.new_state(slot));
    if (object.spec.category == Category::avatar) {
      crowds_.add(object.spec.user.number(), object.id.number());
    }
  }
  base::clear_and_release(spawn_order_);
  restored_ = true;
}

// No host and no node knows the objects yet.
void Cut::mark_restored() {
  for (std::uint32_t slot = 0; slot < state_.objects.slots(); ++slot) {
    state_.objects.mark_moved(slot);
  }
}

// In the order of the calls, except for consecutive spawns: those fill the tables in the order of their positions. A
// frame that mostly spawns is rare, so its requests are freed before the frame needs memory for the objects.
void Cut::apply_requests() {
  constexpr std::size_t ahead = 8;  // placed objects are at random slots
  std::size_t spawns = 0;
  const std::span<const Request> requests = state_.setup.order->requests;
  for (std::size_t begin = 0; begin < requests.size();) {
    std::size_t end = begin;
    while (end < requests.size() && requests[end].kind == Request::Kind::spawn) {
      ++end;
    }
    spawns += end - begin;
    if (end - begin > 1) {
      const auto together = requests.subspan(begin, end - begin);
      for (const PositionedSpawn& placed : order_by_position(together, *state_.setup.space, spawn_order_)) {
        spawn(together[placed.position]);
      }
      base::clear_and_release(spawn_order_);
      begin = end;
    } else {
      if (begin + ahead < requests.size()) {
        state_.objects.prefetch(state_.objects.find(requests[begin + ahead].object.number()));
      }
      apply(requests[begin]);
      ++begin;
    }
  }
  spawned_many_ = restored_ || 8 * spawns > state_.objects.slots();
  if (2 * spawns > requests.size()) {
    base::clear_and_release(state_.setup.order->requests);
  }
  if (any_left_) {
    end_left_users();
  }
  crowds_.settle(state_.objects);
  state_.objects.order_moved();
}

void Cut::apply(const Request& request) {
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
      state_.nodes[request.node].leaving = true;
      return;
    case Request::Kind::partition:
      scheduler_.request_partition();
      return;
    default:
      break;
  }
  const std::uint32_t slot = state_.objects.find(request.object.number());
  if (slot == base::NumberIndex::none || state_.objects.row(slot).object.generation != request.object.generation()) {
    return;
  }
  if (request.kind == Request::Kind::destroy) {
    end_object(slot);
  } else if (request.kind == Request::Kind::place) {
    place(slot, request.spec.pose, true);
  } else if (request.kind == Request::Kind::set_enabled) {
    place(slot, states_.pose(slot), request.spec.enabled);
  } else {
    change(slot, request);
  }
}

void Cut::connect(const Request& request) {
  state_.connect(request.user, request.connection);
  users_changed_ = true;
}

void Cut::set_slots(std::size_t slots) {
  state_.nodes.resize(slots);
  dispatch_.resize();
  state_.ledger.resize(slots);
}

// A new node works from its first frame on, though its region is empty until the map changes at the end of that frame.
void Cut::add_node(const Request& request) {
  set_slots(std::max<std::size_t>(state_.nodes.size(), request.node + 1));
  PeerSession& session = state_.nodes[request.node];
  session = {};
  session.self = Endpoint::node(request.node);
  session.id = request.node_id;
  session.connection = request.connection;
  session.connected = true;
  state_.ledger.join(request.node, state_.frame);
}

// Its objects end when all requests are applied, so that any number of users costs one pass. Requests that name its
// number come after that: the number is not free before the frame is complete.
void Cut::disconnect(UserNumber user) {
  PeerSession& session = state_.users[user];
  state_.lost_users -= session.lost ? 1 : 0;
  session.connected = false;
  users_changed_ = any_left_ = true;
}

void Cut::end_left_users() {
  const auto has_left = [&](UserNumber user) { return user != no_user_number && !state_.users[user].connected; };
  for (std::uint32_t slot = 0; slot < state_.objects.slots(); ++slot) {
    if (state_.objects.alive(slot) && has_left(state_.objects.origin(slot).user)) {
      end_object(slot);
    }
  }
  state_.remove_disconnected();
  any_left_ = false;
}

void Cut::spawn(const Request& request) {
  const std::uint32_t slot = state_.objects.add(request.object, request.spec);
  states_.set_bounds(slot);
  if (request.spec.category == Category::avatar) {
    crowds_.add(request.spec.user.number(), request.object.number());
  }
  if (state_.setup.model == nullptr) {
    return;
  }
  try {
    state_.setup.model->start(request.spec, state_.objects.new_state(slot));
  } catch (...) {
    std::fill_n(state_.objects.new_state(slot), state_.objects.state_bytes(), std::byte{0});
    state_.model_failures.add_current(request.object);
    state_.refuse(Status::model_failed);
  }
}

void Cut::end_object(std::uint32_t slot) {
  states_.end_host_owned(slot);
  const Endpoint host = state_.objects.host(slot);
  if (PeerSession::Opening* const opening = state_.opening_of(host)) {
    opening->drops.push_back(slot);
  } else if (host.is_server()) {
    state_.host.drop(state_.objects.row(slot).object.number);
  }
  if ((state_.objects.marks(slot) & avatar_mark) != 0) {
    crowds_.remove(state_.objects.origin(slot).user, state_.objects.row(slot).object.number);
  }
  state_.objects.end(slot);
}

void Cut::place(std::uint32_t slot, const Pose& pose, bool present) {
  states_.end_host_owned(slot);
  ObjectRow& row = state_.objects.change_row(slot);
  row.pose = pose;
  row.object.flags = present ? messages::flag_present : 0u;
  state_.objects.set_jumped(slot, true);
  state_.objects.mark_moved(slot);
  const Endpoint host = state_.objects.host(slot);
  if (host.is_server() && state_.host.place(row.object.number, pose, present)) {
    return;  // the bounds are set when it has moved
  }
  states_.set_bounds(slot);
  if (PeerSession::Opening* const opening = state_.opening_of(host)) {
    opening->placements.push_back(slot);
  }
}

void Cut::assign_hosts() {
  for (const HostChange& change : hosting_.settle(state_.objects, state_.map, state_.connected, users_changed_)) {
    rehost(change);
  }
  if (std::exchange(restored_, false)) {
    for (std::uint32_t slot = 0; slot < state_.objects.slots(); ++slot) {
      state_.note_host_change(slot);
    }
  }
  list_changed();
}

void Cut::change(std::uint32_t slot, const Request& request) {
  states_.end_host_owned(slot);
  states_.fetch_state(slot);
  ObjectTable& objects = state_.objects;
  if (request.kind == Request::Kind::set_group) {
    objects.set_group(slot, request.spec.group);
  } else if (request.kind == Request::Kind::set_layer) {
    objects.set_layer(slot, request.spec.layer);
  } else if (request.kind == Request::Kind::set_shape) {
    objects.set_shape(slot, request.spec.shape.number());
  } else {
    std::copy_n(state_.setup.order->states.data() + request.state, state_.setup.model->state_bytes(),
                objects.new_state(slot));
  }
  objects.mark_moved(slot);
  changed_slots_.push_back(slot);
}

// The host of a changed object adopts it again, and the other nodes receive it as after a placement.
void Cut::list_changed() {
  std::sort(changed_slots_.begin(), changed_slots_.end());
  changed_slots_.erase(std::unique(changed_slots_.begin(), changed_slots_.end()), changed_slots_.end());
  for (const std::uint32_t slot : changed_slots_) {
    if (!state_.objects.alive(slot)) {
      continue;
    }
    states_.set_bounds(slot);
    const Endpoint host = state_.objects.host(slot);
    if (PeerSession::Opening* const opening = state_.opening_of(host)) {
      opening->adoptions.push_back(slot);
    } else if (host.is_server()) {
      state_.host.adopt(state_.objects.hand_over(slot), state_.objects.state(slot));
    }
  }
  changed_slots_.clear();
}

void Cut::rehost(const HostChange& change) {
  const ObjectRow& row = state_.objects.row(change.slot);
  if (PeerSession::Opening* const from = state_.opening_of(change.from)) {
    from->drops.push_back(change.slot);
  } else if (change.from.is_server()) {
    state_.host.drop(row.object.number);
    // The object may have been placed at this cut, and the next host reports only objects that it moves.
    states_.set_bounds(change.slot);
  }
  if (PeerSession::Opening* const to = state_.opening_of(change.to)) {
    to->adoptions.push_back(change.slot);
  } else if (change.to.is_server()) {
    state_.host.adopt(state_.objects.hand_over(change.slot), state_.objects.state(change.slot));
  }
  if (change.from != Endpoint::none()) {
    ++state_.report().handed_over;
    state_.note_host_change(change.slot);
  }
}

// New hosts need the contacts of the frame before. Rare: users came or left, the map has changed, or a node was lost.
// One pass over the contacts, however many objects changed hosts. The server reads the output lists when it moves its
// own.
void Cut::list_known_contacts() {
  std::vector<NodeNumber>& lost = state_.lost_finders;
  if (state_.host_changes.empty() && lost.empty()) {
    return;
  }
  // Whether the host of the slot's object may not have a contact that this node found.
  const auto misses = [&](std::uint32_t slot, NodeNumber finder) {
    return (state_.objects.marks(slot) & host_changed_mark) != 0 ||
           (std::find(lost.begin(), lost.end(), finder) != lost.end() && state_.objects.host(slot).is_node());
  };
  const auto send = [&](Endpoint host, const Contact& contact) {
    if (PeerSession::Opening* const opening = state_.opening_of(host)) {
      opening->contacts.push_back(contact);
    }
  };
  const auto contacts = state_.ledger.contacts(state_.frame - 1);
  const auto found = state_.ledger.found(state_.frame - 1);
  for (std::size_t i = 0; i < found.size(); ++i) {
    const Endpoint first = state_.objects.host(found[i].a);
    const Endpoint second = state_.objects.host(found[i].b);
    const bool to_first = misses(found[i].a, found[i].by);
    if (to_first) {
      send(first, contacts[i]);
    }
    if (misses(found[i].b, found[i].by) && !(to_first && first == second)) {
      send(second, contacts[i]);
    }
  }
  for (const std::uint32_t slot : state_.host_changes) {
    state_.objects.marks(slot) &= static_cast<ObjectMarks>(~host_changed_mark);
  }
  state_.host_changes.clear();
  lost.clear();
}

}  // namespace ringfence::nodes
