#include "nodes/server/server_role.hpp"

#include <algorithm>
#include <cstring>
#include <utility>

#include "telemetry/clock.hpp"

namespace ringfence::nodes {

using messages::Endpoint;
using messages::MessageType;

ServerRole::ServerRole(const ServerSetup& setup, const regions::RegionMap& map)
    : setup_(setup),
      map_(map),
      balance_(map.grid(), {}, setup.capacities.objects + setup.capacities.contacts),
      objects_(setup.capacities.objects, setup.model == nullptr ? 0 : (setup.model->state_bytes() + 7) / 8 * 8),
      host_(setup.model, setup.deployment == Deployment::user_server ? setup.capacities.objects : 0),
      hosting_(setup.deployment, *setup.space),
      dispatch_(setup.nodes.size(), setup.capacities.objects, setup.capacities.pairs, setup.placement,
                setup.layer_masks, setup.keep_resting),
      ledger_(setup.nodes.size(), setup.capacities.contacts),
      nodes_(setup.nodes.size()),
      node_connections_(setup.nodes),
      recovery_host_(setup.model, 0) {
  for (NodeNumber node = 0; node < nodes_.size(); ++node) {
    PeerSession& session = nodes_[node];
    session.self = Endpoint::node(node);
    session.id = node;
    session.connection = setup.nodes[node];
    session.connected = true;
    session.notices.reserve(std::min(setup.capacities.contacts, 2 * setup.capacities.contacts / nodes_.size() + 64));
  }
  users_.reserve(setup.capacities.users);
  leaving_slots_.reserve(setup.capacities.objects);
  relay_cells_.reserve(setup.capacities.objects);
  spawn_order_.reserve(setup.capacities.objects);
  hand_overs_.reserve(setup.capacities.objects);
  connected_.reserve(setup.capacities.users);
  awaited_users_.reserve(setup.capacities.users);
}

messages::RunHeader ServerRole::head(MessageType type, Endpoint to) const noexcept {
  return {type, Endpoint::server(), to, frame_, map_.epoch()};
}

Step ServerRole::step() {
  bool progressed = false;
  if (stage_ == Stage::waiting) {
    if (setup_.order->ordered.load(std::memory_order_acquire) == frames_) {
      return Step::idle;
    }
    cut();
    progressed = true;
  }
  all_nodes([&](PeerSession& node) {
    progressed |= is_awaited(node) && drain(node);
    return true;
  });
  progressed |= receive_from_users();
  if (any_broken_) [[unlikely]] {
    lose_broken_nodes();
  }
  if (!report().lost.empty()) {
    for (PeerSession& session : nodes_) {
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
  const bool sending = stage_ == Stage::starting_nodes || stage_ == Stage::starting_users ||
                       stage_ == Stage::dispatching || stage_ == Stage::notifying || stage_ == Stage::notifying_users;
  return sending ? Step::blocked : Step::idle;
}

// Whether the frame waits for a message of the node.
bool ServerRole::is_awaited(const PeerSession& node) const noexcept {
  switch (stage_) {
    case Stage::waiting:
      return false;
    case Stage::starting_nodes:
    case Stage::starting_users:
    case Stage::moving:
      return !node.states_received || node.probed_ns != 0;
    case Stage::dispatching:
    case Stage::colliding:
    case Stage::notifying:
      return !node.narrow_done_received || node.probed_ns != 0;
    case Stage::notifying_users:
      return node.probed_ns != 0;
    case Stage::closing:
      return !node.frame_done_received || node.probed_ns != 0;
  }
  return true;
}

// Of many user nodes most have nothing to send at most times, and polling a ring costs a cache miss. So only the rings
// of awaited users are read; unexpected messages stay there until the user is awaited again.
bool ServerRole::receive_from_users() {
  constexpr std::size_t ahead = 4;
  bool any = false;
  for (std::size_t i = 0; i < awaited_users_.size();) {
    if (i + ahead < awaited_users_.size()) {
      users_[awaited_users_[i + ahead]].connection.in->prefetch();
    }
    PeerSession& user = users_[awaited_users_[i]];
    any |= !user.lost && drain(user);
    if (user.lost || (contacts_are_final() ? user.frame_done_received : user.states_received)) {
      awaited_users_[i] = awaited_users_.back();
      awaited_users_.pop_back();
    } else {
      ++i;
    }
  }
  return any;
}

// In user/server deployment the server is a host; otherwise it hosts only objects without another host.
void ServerRole::move_hosted() {
  host_.move(frame_);
  apply_moves(host_);
}

void ServerRole::apply_moves(Host& host) {
  constexpr std::size_t ahead = 6;
  const auto changed = host.changed();
  for (std::size_t i = 0; i < changed.size(); ++i) {
    if (i + ahead < changed.size()) {
      objects_.prefetch(host[changed[i + ahead]].object.slot);
    }
    const std::uint32_t hosted = changed[i];
    const Hosted& object = host[hosted];
    ObjectRow& row = objects_.row(object.object.slot);
    row.pose = object.pose;
    row.object.flags = object.object.flags;
    objects_.bounds(object.object.slot) = setup_.shapes->bounds(row.shape, row.pose, *setup_.space);
    if (objects_.state_bytes() != 0) {
      std::memcpy(objects_.state(object.object.slot), host.state(hosted), objects_.state_bytes());
    }
    objects_.mark_moved(object.object.slot);
  }
  const HostRefusals& refusals = host.refusals();
  report().refused[static_cast<std::size_t>(Status::model_failed)] += refusals.model_failed;
  report().refused[static_cast<std::size_t>(Status::not_finite)] += refusals.not_finite;
  report().refused[static_cast<std::size_t>(Status::not_unit)] += refusals.not_unit;
}

const Pose& ServerRole::pose(std::uint32_t slot) const noexcept {
  const ObjectRow& row = objects_.row(slot);
  if ((objects_.marks(slot) & host_owned_mark) == 0) {
    return row.pose;
  }
  const Host& host = *nodes_[objects_.host(slot).number()].connection.node_contacts->host;
  return host[host.find(row.object.number)].pose;
}

// Stores the host-owned state of an object in `frame`, unless the state was reported or stored since.
void ServerRole::store_state(const PeerSession& session, std::uint64_t frame, const messages::ObjectRef& object,
                             const Pose& pose, const std::byte* state) {
  const std::uint32_t slot = objects_.find(object);
  if (slot == base::NumberIndex::none || objects_.host(slot) != session.self) {
    return;
  }
  ObjectMarks& marks = objects_.marks(slot);
  if ((marks & (host_owned_mark | reported_mark)) != host_owned_mark) {
    return;
  }
  objects_.row(slot).pose = pose;
  std::copy_n(state, objects_.state_bytes(), objects_.state(slot));
  bounds_are_stale_ = true;
  if (frame == frame_) {
    marks |= reported_mark;
    objects_.mark_moved_host_only(slot);
    host_owned_moved_ -= session.lost ? 0 : 1;  // the node will report the number of states it kept
  }
}

// Brings all rows, states and bounds to this frame. The nodes have moved and wait.
void ServerRole::refresh_objects() {
  for (const PeerSession& session : nodes_) {
    if (session.lost || session.connection.node_contacts == nullptr) {
      continue;
    }
    const Host& host = *session.connection.node_contacts->host;
    for (std::size_t i = 0; i < host.size(); ++i) {
      const Hosted& object = host[i];
      if ((object.object.flags & messages::flag_host_owned) != 0) {
        store_state(session, frame_, object.object, object.pose, host.state(i));
      }
    }
  }
  if (!std::exchange(bounds_are_stale_, false)) {
    return;
  }
  for (std::uint32_t slot = 0; slot < objects_.slots(); ++slot) {
    if (objects_.present()[slot] != 0) {
      const ObjectRow& row = objects_.row(slot);
      objects_.bounds(slot) = setup_.shapes->bounds(row.shape, row.pose, *setup_.space);
    }
  }
}

void ServerRole::detect() {
  spend(ringfence::Stage::move, telemetry::now_ns());
  const bool all_objects = update_scope_ == Dispatch::UpdateScope::all_objects;
  if (all_objects) {
    refresh_objects();
  }
  dispatch_.list_updates(objects_, map_, update_scope_);
  ghosts_exchanged_ = !all_objects && setup_.placement == Placement::region;
  if (ghosts_exchanged_) {
    open_ghost_gates();
  }
  update_scope_ = Dispatch::UpdateScope::changes;
  dispatch_.start();
}

// Before the last position is sent: nodes that have received it enter their gates.
void ServerRole::open_ghost_gates() {
  for (const PeerSession& session : nodes_) {
    if (session.connection.node_contacts != nullptr) {
      session.connection.node_contacts->ghost_updates.gate.admit();
    }
  }
}

// A node is lost: ghost updates are no longer read in this frame, by no node, because all objects are sent again.
void ServerRole::close_ghost_gates() noexcept {
  for (const PeerSession& session : nodes_) {
    if (session.connection.node_contacts != nullptr) {
      session.connection.node_contacts->ghost_updates.gate.bar();
    }
  }
}

bool ServerRole::all_nodes_done() noexcept {
  return all_nodes([](const PeerSession& node) { return node.frame_done_received; });
}

// Whether no lost node is inside its gate: otherwise peers must not begin the next frame. Abandoned nodes have no
// peers.
bool ServerRole::ghost_gates_are_left() const noexcept {
  return nodes_abandoned_ || std::none_of(nodes_.begin(), nodes_.end(), [](const PeerSession& session) {
           return session.lost && session.connection.node_contacts != nullptr &&
                  session.connection.node_contacts->ghost_updates.gate.is_inside();
         });
}

// Makes one transition of the frame; false if it has to wait.
bool ServerRole::advance() { return (!losses_pending_ || send_losses()) && advance_stage(); }

bool ServerRole::advance_stage() {
  switch (stage_) {
    case Stage::waiting:
      return false;
    case Stage::starting_nodes:
      if (!all_nodes([&](PeerSession& node) { return open(node) && note_first(node.started_ns); })) {
        return false;
      }
      spend_cpu(&PathReport::start_nodes_ms);
      charge_notified(report().path.start_nodes_ms, begin_ns_, &PeerSession::started_ns, &PeerSession::started_ms);
      start_users();
      stage_ = Stage::starting_users;
      return true;
    case Stage::starting_users:
      if (!all_users([&](PeerSession& user) { return open(user); })) {
        return false;
      }
      spend_cpu(&PathReport::start_users_ms);
      move_hosted();
      stage_ = Stage::moving;
      return true;
    case Stage::moving:
      if (!all_nodes([](const PeerSession& node) { return node.states_received; }) || !awaited_users_.empty()) {
        return false;
      }
      spend_cpu(&PathReport::ingest_ms);
      detect();
      stage_ = Stage::dispatching;
      return true;
    case Stage::dispatching:
      if (!dispatch_.pump(node_connections_, objects_, map_, head(MessageType::pairs, Endpoint::none()),
                          report().traffic)) {
        return false;
      }
      if (setup_.placement == Placement::server) {
        report().candidates = dispatch_.candidates();
      }
      // Sweeping and sending alternate; the report separates them.
      spend(ringfence::Stage::broad_phase, mark_ns_ + dispatch_.sweep_ns());
      spend(ringfence::Stage::dispatch, telemetry::now_ns());
      spend_cpu(&PathReport::dispatch_ms);
      // Poses are final, so states can be published while the nodes test.
      publish();
      spend_cpu(&PathReport::publish_ms);
      spend(ringfence::Stage::notify, telemetry::now_ns());
      stage_ = Stage::colliding;
      return true;
    case Stage::colliding:
      if (!relays_are_final_ && all_published()) {
        allow_reading();
        plan_map();
      }
      if (!all_nodes([](const PeerSession& node) { return node.narrow_done_received; })) {
        return false;
      }
      spend_cpu(&PathReport::receive_contacts_ms);
      collect();
      spend_cpu(&PathReport::collect_ms);
      notify_ns_ = mark_ns_;
      stage_ = Stage::notifying;
      return true;
    case Stage::notifying:
      if (!all_nodes([&](PeerSession& node) { return notify(node) && note_first(node.notified_ns); })) {
        return false;
      }
      spend_cpu(&PathReport::notify_ms);
      charge_notified(report().path.notify_ms, notify_ns_, &PeerSession::notified_ns, &PeerSession::notified_ms);
      start_notifying_users();
      stage_ = Stage::notifying_users;
      return true;
    case Stage::notifying_users:
      // Users before nodes, since nodes need longer to end.
      if (!users_are_notified_) {
        users_are_notified_ = true;
        for (const UserNumber user : awaited_users_) {
          users_are_notified_ &= notify(users_[user]);
        }
        spend_cpu(&PathReport::notify_users_ms);
      }
      if (!awaited_users_.empty()) {
        return false;
      }
      spend_cpu(&PathReport::receive_user_acks_ms);
      stage_ = Stage::closing;
      return true;
    case Stage::closing:
      if (!all_nodes_done() || !ghost_gates_are_left() || !ledger_.complete()) {
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
  const std::uint64_t now = telemetry::now_ns();
  spend(ringfence::Stage::notify, now);
  spend_cpu(&PathReport::finish_ms);
  FrameReport& frame = report();
  frame.objects = objects_.live();
  frame.map_epoch = map_.epoch();
  frame.moved = static_cast<std::uint64_t>(static_cast<std::int64_t>(objects_.moved().size()) + host_owned_moved_);
  frame.frame_ms = telemetry::to_ms(now - begin_ns_);
  frame.server_cpu_ms = telemetry::to_ms(telemetry::thread_cpu_ns() - cpu_begin_ns_);
  for (NodeReport& node : frame.nodes) {
    node.wait_ms = std::max(0.0, frame.frame_ms - node.busy_ms);
  }
  frame.grown = (objects_.slots() > setup_.capacities.objects ? 1u : 0u) +
                (frame.candidates > setup_.capacities.pairs ? 1u : 0u) +
                (frame.contacts > setup_.capacities.contacts ? 1u : 0u);
  if (map_changed_) {
    update_scope_ = hosts_exchange_objects_ ? Dispatch::UpdateScope::not_hosted : Dispatch::UpdateScope::all_objects;
  }
  map_changed_ = rescan_hosts_ = map_precedes_frame_ = false;
  stage_ = Stage::waiting;
  setup_.order->completed.store(frames_, std::memory_order_release);
  if (setup_.order->caller != nullptr) {
    setup_.order->caller->ring();
  }
}

}  // namespace ringfence::nodes
