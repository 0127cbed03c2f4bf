#include "nodes/server/server_role.hpp"

#include <algorithm>
#include <cstring>
#include <utility>

#include "telemetry/clock.hpp"

namespace ringfence::nodes {

using messages::Endpoint;
using messages::MessageType;

ServerRole::ServerRole(const ServerSetup& setup, const regions::RegionMap& map)
    : state_(setup, map),
      statistics_(state_),
      balance_(map.grid(), {}, setup.capacities.objects + setup.capacities.contacts),
      hosting_(setup.deployment, *setup.space),
      dispatch_(setup.nodes.size(), setup.capacities.objects, setup.capacities.pairs, setup.placement,
                setup.layer_masks, setup.keep_resting),
      recovery_host_(setup.model, 0) {
  relay_cells_.reserve(setup.capacities.objects);
  spawn_order_.reserve(setup.capacities.objects);
}

Step ServerRole::step() {
  bool progressed = false;
  if (state_.stage == FrameStage::waiting) {
    if (state_.setup.order->ordered.load(std::memory_order_acquire) == frames_) {
      return Step::idle;
    }
    cut();
    progressed = true;
  }
  state_.all_nodes([&](PeerSession& node) {
    progressed |= is_awaited(node) && drain(node);
    return true;
  });
  progressed |= receive_from_users();
  if (any_broken_) [[unlikely]] {
    lose_broken_nodes();
  }
  if (!state_.report().lost.empty()) {
    for (PeerSession& session : state_.nodes) {
      progressed |= session.lost && drain_lost(session);
    }
  }
  bool advanced = false;
  while (advance()) {
    advanced = true;
  }
  // Receiving is not progress: a flooding sender must not postpone the deadline check.
  if (advanced || check_deadlines() || progressed) {
    return Step::progressed;
  }
  const bool sending = state_.stage == FrameStage::starting_nodes || state_.stage == FrameStage::starting_users ||
                       state_.stage == FrameStage::dispatching || state_.stage == FrameStage::notifying ||
                       state_.stage == FrameStage::notifying_users;
  return sending ? Step::blocked : Step::idle;
}

// Whether the frame waits for a message of the node.
bool ServerRole::is_awaited(const PeerSession& node) const noexcept {
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

// Of many user nodes most have nothing to send at most times, and polling a ring costs a cache miss. So only the rings
// of awaited users are read; unexpected messages stay there until the user is awaited again.
bool ServerRole::receive_from_users() {
  constexpr std::size_t ahead = 4;
  bool any = false;
  for (std::size_t i = 0; i < state_.awaited_users.size();) {
    if (i + ahead < state_.awaited_users.size()) {
      state_.users[state_.awaited_users[i + ahead]].connection.in->prefetch();
    }
    PeerSession& user = state_.users[state_.awaited_users[i]];
    any |= !user.lost && drain(user);
    if (user.lost || (state_.contacts_are_final() ? user.received.frame_done : user.received.states)) {
      state_.awaited_users[i] = state_.awaited_users.back();
      state_.awaited_users.pop_back();
    } else {
      ++i;
    }
  }
  return any;
}

// In user/server deployment the server is a host; otherwise it hosts only objects without another host.
void ServerRole::move_hosted() {
  state_.host.move(state_.frame);
  apply_moves(state_.host);
}

void ServerRole::apply_moves(Host& host) {
  constexpr std::size_t ahead = 6;
  const auto changed = host.changed();
  for (std::size_t i = 0; i < changed.size(); ++i) {
    if (i + ahead < changed.size()) {
      state_.objects.prefetch(host[changed[i + ahead]].object.slot);
    }
    const std::uint32_t hosted = changed[i];
    const Hosted& object = host[hosted];
    ObjectRow& row = state_.objects.row(object.object.slot);
    row.pose = object.pose;
    row.object.flags = object.object.flags;
    state_.objects.bounds(object.object.slot) = state_.setup.shapes->bounds(row.shape, row.pose, *state_.setup.space);
    if (state_.objects.state_bytes() != 0) {
      std::memcpy(state_.objects.state(object.object.slot), host.state(hosted), state_.objects.state_bytes());
    }
    state_.objects.mark_moved(object.object.slot);
  }
  const HostRefusals& refusals = host.refusals();
  state_.report().refused[static_cast<std::size_t>(Status::model_failed)] += refusals.model_failed;
  state_.report().refused[static_cast<std::size_t>(Status::not_finite)] += refusals.not_finite;
  state_.report().refused[static_cast<std::size_t>(Status::not_unit)] += refusals.not_unit;
}

const Pose& ServerRole::pose(std::uint32_t slot) const noexcept {
  const ObjectRow& row = state_.objects.row(slot);
  if ((state_.objects.marks(slot) & host_owned_mark) == 0) {
    return row.pose;
  }
  const Host& host = *state_.nodes[state_.objects.host(slot).number()].connection.node_contacts->host;
  return host[host.find(row.object.number)].pose;
}

// Stores the host-owned state of an object in `frame`, unless the state was reported or stored since.
void ServerRole::store_state(const PeerSession& session, std::uint64_t frame, const messages::ObjectRef& object,
                             const Pose& pose, const std::byte* state) {
  const std::uint32_t slot = state_.objects.find(object);
  if (slot == base::NumberIndex::none || state_.objects.host(slot) != session.self) {
    return;
  }
  ObjectMarks& marks = state_.objects.marks(slot);
  if ((marks & (host_owned_mark | reported_mark)) != host_owned_mark) {
    return;
  }
  state_.objects.row(slot).pose = pose;
  std::copy_n(state, state_.objects.state_bytes(), state_.objects.state(slot));
  bounds_are_stale_ = true;
  if (frame == state_.frame) {
    marks |= reported_mark;
    state_.objects.mark_moved_host_only(slot);
    host_owned_moved_ -= session.lost ? 0 : 1;  // the node will report the number of states it kept
  }
}

// Brings all rows, states and bounds to this frame. The nodes have moved and wait.
void ServerRole::refresh_objects() {
  for (const PeerSession& session : state_.nodes) {
    if (session.lost || session.connection.node_contacts == nullptr) {
      continue;
    }
    const Host& host = *session.connection.node_contacts->host;
    for (std::size_t i = 0; i < host.size(); ++i) {
      const Hosted& object = host[i];
      if ((object.object.flags & messages::flag_host_owned) != 0) {
        store_state(session, state_.frame, object.object, object.pose, host.state(i));
      }
    }
  }
  if (!std::exchange(bounds_are_stale_, false)) {
    return;
  }
  for (std::uint32_t slot = 0; slot < state_.objects.slots(); ++slot) {
    if (state_.objects.present()[slot] != 0) {
      const ObjectRow& row = state_.objects.row(slot);
      state_.objects.bounds(slot) = state_.setup.shapes->bounds(row.shape, row.pose, *state_.setup.space);
    }
  }
}

void ServerRole::detect() {
  statistics_.charge(Stage::move);
  const bool all_objects = state_.map_change.updates == Dispatch::UpdateScope::all_objects;
  if (all_objects) {
    refresh_objects();
  }
  dispatch_.list_updates(state_.objects, state_.map, state_.map_change.updates);
  ghosts_exchanged_ = !all_objects && state_.setup.placement == Placement::region;
  if (ghosts_exchanged_) {
    open_ghost_gates();
  }
  state_.map_change.updates = Dispatch::UpdateScope::changes;
  dispatch_.start(state_.nodes);
}

// Before the last position is sent: nodes that have received it enter their gates.
void ServerRole::open_ghost_gates() {
  for (const PeerSession& session : state_.nodes) {
    if (session.connection.node_contacts != nullptr) {
      session.connection.node_contacts->ghost_updates.gate.admit();
    }
  }
}

// A node is lost: ghost updates are no longer read in this frame, by no node, because all objects are sent again.
void ServerRole::close_ghost_gates() noexcept {
  for (const PeerSession& session : state_.nodes) {
    if (session.connection.node_contacts != nullptr) {
      session.connection.node_contacts->ghost_updates.gate.bar();
    }
  }
}

bool ServerRole::all_nodes_done() noexcept {
  return state_.all_nodes([](const PeerSession& node) { return node.received.frame_done; });
}

// Whether no lost node is inside its gate: otherwise peers must not begin the next frame. Abandoned nodes have no
// peers.
bool ServerRole::ghost_gates_are_left() const noexcept {
  return nodes_abandoned_ || std::none_of(state_.nodes.begin(), state_.nodes.end(), [](const PeerSession& session) {
           return session.lost && session.connection.node_contacts != nullptr &&
                  session.connection.node_contacts->ghost_updates.gate.is_inside();
         });
}

// Makes one transition of the frame; false if it has to wait.
bool ServerRole::advance() { return (!losses_pending_ || send_losses()) && advance_stage(); }

bool ServerRole::advance_stage() {
  switch (state_.stage) {
    case FrameStage::waiting:
      return false;
    case FrameStage::starting_nodes:
      if (!state_.all_nodes([&](PeerSession& node) { return open(node) && Statistics::note_reached(node.started); })) {
        return false;
      }
      statistics_.charge_cpu(&PathReport::start_nodes_ms);
      statistics_.charge_reached(state_.report().path.start_nodes_ms, state_.begin_ns, &PeerSession::started);
      start_users();
      state_.stage = FrameStage::starting_users;
      return true;
    case FrameStage::starting_users:
      if (!state_.all_users([&](PeerSession& user) { return open(user); })) {
        return false;
      }
      statistics_.charge_cpu(&PathReport::start_users_ms);
      move_hosted();
      state_.stage = FrameStage::moving;
      return true;
    case FrameStage::moving:
      if (!state_.all_nodes([](const PeerSession& node) { return node.received.states; }) ||
          !state_.awaited_users.empty()) {
        return false;
      }
      statistics_.charge_cpu(&PathReport::ingest_ms);
      detect();
      state_.stage = FrameStage::dispatching;
      return true;
    case FrameStage::dispatching:
      if (!dispatch_.pump(state_.objects, state_.map, state_.head(MessageType::pairs, Endpoint::none()),
                          state_.report().traffic)) {
        return false;
      }
      if (state_.setup.placement == Placement::server) {
        state_.report().candidates = dispatch_.candidates();
      }
      // Sweeping and sending alternate; the report separates them.
      statistics_.charge_part(Stage::broad_phase, dispatch_.sweep_ns());
      statistics_.charge(Stage::dispatch);
      statistics_.charge_cpu(&PathReport::dispatch_ms);
      // Poses are final, so states can be published while the nodes test.
      publish();
      statistics_.charge_cpu(&PathReport::publish_ms);
      statistics_.charge(Stage::notify);
      state_.stage = FrameStage::colliding;
      return true;
    case FrameStage::colliding:
      if (!relays_are_final_ && all_published()) {
        allow_reading();
        plan_map();
      }
      if (!state_.all_nodes([](const PeerSession& node) { return node.received.narrow_done; })) {
        return false;
      }
      statistics_.charge_cpu(&PathReport::receive_contacts_ms);
      collect();
      statistics_.charge_cpu(&PathReport::collect_ms);
      state_.notify_ns = statistics_.mark_ns();
      state_.stage = FrameStage::notifying;
      return true;
    case FrameStage::notifying:
      if (!state_.all_nodes(
              [&](PeerSession& node) { return notify(node) && Statistics::note_reached(node.notified); })) {
        return false;
      }
      statistics_.charge_cpu(&PathReport::notify_ms);
      statistics_.charge_reached(state_.report().path.notify_ms, state_.notify_ns, &PeerSession::notified);
      start_notifying_users();
      state_.stage = FrameStage::notifying_users;
      return true;
    case FrameStage::notifying_users:
      // Users before nodes, since nodes need longer to end.
      if (!users_are_notified_) {
        users_are_notified_ = true;
        for (const UserNumber user : state_.awaited_users) {
          users_are_notified_ &= notify(state_.users[user]);
        }
        statistics_.charge_cpu(&PathReport::notify_users_ms);
      }
      if (!state_.awaited_users.empty()) {
        return false;
      }
      statistics_.charge_cpu(&PathReport::receive_user_acks_ms);
      state_.stage = FrameStage::closing;
      return true;
    case FrameStage::closing:
      if (!all_nodes_done() || !ghost_gates_are_left() || !state_.ledger.complete()) {
        return false;
      }
      finish();
      return false;
  }
  return false;
}

void ServerRole::finish() {
  count_contacts();
  keep_last_node();
  statistics_.finish(
      static_cast<std::uint64_t>(static_cast<std::int64_t>(state_.objects.moved().size()) + host_owned_moved_));
  if (state_.map_change.at_end) {
    state_.map_change.updates = state_.map_change.hosts_exchange_objects ? Dispatch::UpdateScope::not_hosted
                                                                         : Dispatch::UpdateScope::all_objects;
  }
  state_.map_change.at_end = state_.map_change.rescan_hosts = state_.map_change.precedes_frame = false;
  state_.stage = FrameStage::waiting;
  state_.setup.order->completed.store(frames_, std::memory_order_release);
  if (state_.setup.order->caller != nullptr) {
    state_.setup.order->caller->ring();
  }
}

}  // namespace ringfence::nodes
