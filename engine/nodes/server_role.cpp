#include "nodes/server_role.hpp"

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
      node_lines_(setup.nodes),
      rescue_(setup.model, 0) {
  for (NodeNumber node = 0; node < nodes_.size(); ++node) {
    Party& party = nodes_[node];
    party.self = Endpoint::node(node);
    party.line = setup.nodes[node];
    party.connected = true;
    party.notices.reserve(std::min(setup.capacities.contacts, 2 * setup.capacities.contacts / nodes_.size() + 64));
  }
  users_.reserve(setup.capacities.users);
  leaving_.reserve(setup.capacities.objects);
  relay_cells_.reserve(setup.capacities.objects);
  spawn_order_.reserve(setup.capacities.objects);
  hand_overs_.reserve(setup.capacities.objects);
  connected_.reserve(setup.capacities.users);
  awaited_users_.reserve(setup.capacities.users);
}

messages::RunHead ServerRole::head(MessageType type, Endpoint to) const noexcept {
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
  all_nodes([&](Party& node) {
    progressed |= awaits(node) && drain(node);
    return true;
  });
  progressed |= hear_users();
  if (!report().lost.empty()) {
    for (Party& party : nodes_) {
      progressed |= party.lost && drain_lost(party);
    }
  }
  bool advanced = false;
  while (advance()) {
    advanced = true;
  }
  // Being heard is not getting on: who talks without end must not keep the others from their deadlines.
  if (advanced || watch() || progressed) {
    return Step::progressed;
  }
  const bool sending = stage_ == Stage::opening || stage_ == Stage::inviting || stage_ == Stage::dispatching ||
                       stage_ == Stage::notifying || stage_ == Stage::informing;
  return sending ? Step::blocked : Step::idle;
}

// Whether the frame waits for a word of the node.
bool ServerRole::awaits(const Party& node) const noexcept {
  switch (stage_) {
    case Stage::waiting:
      return false;
    case Stage::opening:
    case Stage::inviting:
    case Stage::moving:
      return !node.states_heard || node.probed_ns != 0;
    case Stage::dispatching:
    case Stage::colliding:
    case Stage::notifying:
      return !node.tested_heard || node.probed_ns != 0;
    case Stage::informing:
      return node.probed_ns != 0;
    case Stage::closing:
      return !node.told_heard || node.probed_ns != 0;
  }
  return true;
}

// Of a hundred user nodes most have nothing to say at most times, and to look is to fetch lines that they write: what
// they say unasked is heard when they are next asked.
bool ServerRole::hear_users() {
  constexpr std::size_t ahead = 4;
  bool any = false;
  for (std::size_t i = 0; i < awaited_users_.size();) {
    if (i + ahead < awaited_users_.size()) {
      users_[awaited_users_[i + ahead]].line.in->fetch();
    }
    Party& user = users_[awaited_users_[i]];
    any |= !user.lost && drain(user);
    if (user.lost || (is_telling() ? user.told_heard : user.states_heard)) {
      awaited_users_[i] = awaited_users_.back();
      awaited_users_.pop_back();
    } else {
      ++i;
    }
  }
  return any;
}

// In user/server deployment the server is the host; elsewhere only of what has no other.
void ServerRole::move_own() {
  host_.move(frame_);
  take_moves(host_);
}

void ServerRole::take_moves(Host& host) {
  constexpr std::size_t ahead = 6;
  const auto changed = host.changed();
  for (std::size_t i = 0; i < changed.size(); ++i) {
    if (i + ahead < changed.size()) {
      objects_.fetch(host[changed[i + ahead]].object.slot);
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
  if ((objects_.marks(slot) & kept_mark) == 0) {
    return row.pose;
  }
  const Host& host = *nodes_[objects_.host(slot).number()].line.findings->host;
  return host[host.find(row.object.number)].pose;
}

// Takes in what a host has kept to itself of an object in `frame`, unless it was told or taken in since.
void ServerRole::take_in(const Party& party, std::uint64_t frame, const messages::ObjectRef& object, const Pose& pose,
                         const std::byte* state) {
  const std::uint32_t slot = objects_.find(object);
  if (slot == NumberIndex::none || objects_.host(slot) != party.self) {
    return;
  }
  ObjectMarks& marks = objects_.marks(slot);
  if ((marks & (kept_mark | reported_mark)) != kept_mark) {
    return;
  }
  objects_.row(slot).pose = pose;
  std::copy_n(state, objects_.state_bytes(), objects_.state(slot));
  bounds_are_stale_ = true;
  if (frame == frame_) {
    marks |= reported_mark;
    objects_.mark_moved_alone(slot);
    kept_moved_ -= party.lost ? 0 : 1;  // it will say how many it kept
  }
}

// So that all rows, states and bounds are of this frame. The nodes have moved, and wait.
void ServerRole::refresh_objects() {
  for (const Party& party : nodes_) {
    if (party.lost || party.line.findings == nullptr) {
      continue;
    }
    const Host& host = *party.line.findings->host;
    for (std::size_t i = 0; i < host.size(); ++i) {
      const Hosted& object = host[i];
      if ((object.object.flags & messages::flag_kept) != 0) {
        take_in(party, frame_, object.object, object.pose, host.state(i));
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
  const bool everything = telling_ == Dispatch::Telling::everything;
  if (everything) {
    refresh_objects();
  }
  dispatch_.list_updates(objects_, map_, telling_);
  peers_told_ = !everything && setup_.placement == Placement::region;
  if (peers_told_) {
    admit_to_halos();
  }
  telling_ = Dispatch::Telling::changes;
  dispatch_.start();
}

// Before the last position is sent, whereupon they enter.
void ServerRole::admit_to_halos() {
  for (const Party& party : nodes_) {
    if (party.line.findings != nullptr) {
      party.line.findings->halo.gate.admit();
    }
  }
}

// A node is lost: it hears no more of its peers. Nor do the others, if they have not: they hear everything anew.
void ServerRole::bar_from_halos() noexcept {
  for (const Party& party : nodes_) {
    if (party.line.findings != nullptr) {
      party.line.findings->halo.gate.bar();
    }
  }
}

// Of those that are lost: peers may begin the next frame.
bool ServerRole::halos_are_left() const noexcept {
  return std::none_of(nodes_.begin(), nodes_.end(), [](const Party& party) {
    return party.lost && party.line.findings != nullptr && party.line.findings->halo.gate.is_inside();
  });
}

// One transition of the frame; false where it has to wait.
bool ServerRole::advance() { return (!losses_to_tell_ || tell_losses()) && advance_stage(); }

bool ServerRole::advance_stage() {
  switch (stage_) {
    case Stage::waiting:
      return false;
    case Stage::opening:
      if (!all_nodes([&](Party& node) { return open(node) && note_first(node.opened_ns); })) {
        return false;
      }
      spend_cpu(&PathReport::open_ms);
      charge_told(report().path.open_ms, begin_ns_, &Party::opened_ns, &Party::opened_ms);
      start_users();
      stage_ = Stage::inviting;
      return true;
    case Stage::inviting:
      if (!all_users([&](Party& user) { return open(user); })) {
        return false;
      }
      spend_cpu(&PathReport::invite_ms);
      move_own();
      stage_ = Stage::moving;
      return true;
    case Stage::moving:
      if (!all_nodes([](const Party& node) { return node.states_heard; }) || !awaited_users_.empty()) {
        return false;
      }
      spend_cpu(&PathReport::ingest_ms);
      detect();
      stage_ = Stage::dispatching;
      return true;
    case Stage::dispatching:
      if (!dispatch_.pump(node_lines_, objects_, map_, head(MessageType::pairs, Endpoint::none()), report().traffic)) {
        return false;
      }
      if (setup_.placement == Placement::server) {
        report().candidates = dispatch_.candidates();
      }
      // Sweeping and sending take turns; the report keeps them apart.
      spend(ringfence::Stage::broad_phase, mark_ns_ + dispatch_.sweep_ns());
      spend(ringfence::Stage::dispatch, telemetry::now_ns());
      spend_cpu(&PathReport::dispatch_ms);
      // Poses are frozen, so states can be relayed while the nodes test.
      publish();
      spend_cpu(&PathReport::publish_ms);
      spend(ringfence::Stage::notify, telemetry::now_ns());
      stage_ = Stage::colliding;
      return true;
    case Stage::colliding:
      if (!relays_listed_ && all_published()) {
        let_look();
        draw_map();
      }
      if (!all_nodes([](const Party& node) { return node.tested_heard; })) {
        return false;
      }
      spend_cpu(&PathReport::hear_ms);
      collect();
      spend_cpu(&PathReport::collect_ms);
      notify_ns_ = mark_ns_;
      stage_ = Stage::notifying;
      return true;
    case Stage::notifying:
      if (!all_nodes([&](Party& node) { return notify(node) && note_first(node.notified_ns); })) {
        return false;
      }
      spend_cpu(&PathReport::notify_ms);
      charge_told(report().path.notify_ms, notify_ns_, &Party::notified_ns, &Party::notified_ms);
      start_telling_users();
      stage_ = Stage::informing;
      return true;
    case Stage::informing:
      // Users are heard before nodes, which have more to end.
      if (!informed_) {
        informed_ = true;
        for (const UserNumber user : awaited_users_) {
          informed_ &= notify(users_[user]);
        }
        spend_cpu(&PathReport::inform_ms);
      }
      if (!awaited_users_.empty()) {
        return false;
      }
      spend_cpu(&PathReport::heed_ms);
      stage_ = Stage::closing;
      return true;
    case Stage::closing:
      if (!all_nodes([](const Party& node) { return node.told_heard; }) || !ledger_.complete() || !halos_are_left()) {
        return false;
      }
      finish();
      return false;
  }
  return false;
}

void ServerRole::finish() {
  count_contacts();
  const std::uint64_t now = telemetry::now_ns();
  spend(ringfence::Stage::notify, now);
  spend_cpu(&PathReport::finish_ms);
  FrameReport& frame = report();
  frame.objects = objects_.live();
  frame.map_epoch = map_.epoch();
  frame.moved = static_cast<std::uint64_t>(static_cast<std::int64_t>(objects_.moved().size()) + kept_moved_);
  frame.frame_ms = telemetry::to_ms(now - begin_ns_);
  frame.server_cpu_ms = telemetry::to_ms(telemetry::thread_cpu_ns() - cpu_begin_ns_);
  for (NodeReport& node : frame.nodes) {
    node.wait_ms = std::max(0.0, frame.frame_ms - node.busy_ms);
  }
  frame.grown = (objects_.slots() > setup_.capacities.objects ? 1u : 0u) +
                (frame.candidates > setup_.capacities.pairs ? 1u : 0u) +
                (frame.contacts > setup_.capacities.contacts ? 1u : 0u);
  if (map_changed_) {
    telling_ = hosts_tell_ ? Dispatch::Telling::not_hosted : Dispatch::Telling::everything;
  }
  map_changed_ = rescan_hosts_ = map_first_ = false;
  stage_ = Stage::waiting;
  setup_.order->completed.store(frames_, std::memory_order_release);
  if (setup_.order->caller != nullptr) {
    setup_.order->caller->ring();
  }
}

}  // namespace ringfence::nodes
