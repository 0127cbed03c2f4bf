#include "nodes/server_role.hpp"

#include <algorithm>
#include <cstring>
#include <utility>

#include "nodes/contact_order.hpp"
#include "telemetry/track.hpp"

namespace ringfence::nodes {

using messages::Endpoint;
using messages::MessageType;
using messages::MessageView;

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
  all_parties([&](Party& party) {
    progressed |= drain(party);
    return true;
  });
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
  const bool sending = stage_ == Stage::opening || stage_ == Stage::dispatching || stage_ == Stage::notifying;
  return sending ? Step::blocked : Step::idle;
}

// What passed since the last mark is charged to a stage of the report, less what ingest took of it.
void ServerRole::spend(ringfence::Stage stage, std::uint64_t now) noexcept {
  const std::uint64_t passed = now - mark_ns_;
  const std::uint64_t ingest = std::min(ingest_ns_, passed);
  report().stage_ms[static_cast<std::size_t>(stage)] += telemetry::to_ms(passed - ingest);
  report().stage_ms[static_cast<std::size_t>(ringfence::Stage::ingest)] += telemetry::to_ms(ingest);
  if (setup_.track != nullptr) {
    setup_.track->add(name_of(stage), mark_ns_, now);
  }
  mark_ns_ = now;
  ingest_ns_ = 0;
}

void ServerRole::spend_cpu(double PathReport::*step) noexcept {
  const std::uint64_t now = telemetry::thread_cpu_ns();
  report().path.*step += telemetry::to_ms(now - cpu_mark_ns_);
  cpu_mark_ns_ = now;
}

// Reads what a party has said, up to a size: one that never stops talking must not keep the others waiting.
bool ServerRole::drain(Party& party) {
  constexpr std::size_t most_at_once = 65536;
  bool any = false;
  std::size_t taken = 0;
  for (auto bytes = party.line.in->next(); !bytes.empty();
       bytes = taken < most_at_once ? party.line.in->next() : std::span<const std::byte>{}) {
    taken += party.self.is_user() ? bytes.size() : 0;
    MessageView message;
    if (party.self.is_user() && is_over_quota(party, bytes)) {
      refuse(party, Status::over_quota);
    } else if (messages::decode(bytes, objects_.state_bytes(), message) == Status::ok &&
               ((message.header().source == party.self.value && message.header().frame == frame_) ||
                (party.self.is_node() && message.type() == MessageType::here))) {
      // An answer to a probe may come a frame late, and from before the sender was numbered anew.
      receive(party, message);
    } else {
      refuse(party, Status::bad_message);
    }
    any = true;
  }
  if (any) {
    party.line.in->release();
    if (setup_.node_deadline_ns != 0) {
      party.heard_ns = telemetry::now_ns();
      party.probed_ns = 0;
    }
  }
  return any;
}

// Whether the message is left out for its sender's having said too much. That it has told all is believed nevertheless,
// and so is that it is done: otherwise the frame would wait for it.
bool ServerRole::is_over_quota(Party& party, std::span<const std::byte> bytes) {
  party.heard_bytes += bytes.size();
  if (setup_.quotas.bytes == 0 || party.heard_bytes <= setup_.quotas.bytes) {
    return false;
  }
  MessageView message;
  const bool valid = messages::decode(bytes, objects_.state_bytes(), message) == Status::ok &&
                     message.header().source == party.self.value && message.header().frame == frame_;
  if (valid && message.type() == MessageType::told) {
    return false;
  }
  party.states_heard |= valid && message.type() == MessageType::state_update && message.last();
  return true;
}

// Counted all, told the first of: a user node that sends rubbish must not make the server send as much.
void ServerRole::refuse(Party& sender, Status reason, ObjectNumber number) {
  refuse(reason);
  if (sender.self.is_user() && sender.new_refusals.size() < Party::most_refusals) {
    sender.new_refusals.push_back({number, static_cast<std::uint32_t>(reason)});
  }
}

void ServerRole::add(messages::TrafficCounts& counts, const messages::Header& header) noexcept {
  TrafficReport& traffic = counts[static_cast<std::size_t>(traffic_of(static_cast<MessageType>(header.type)))];
  ++traffic.messages;
  traffic.records += header.count;
  traffic.bytes += header.bytes;
}

// What is read where it lies counts as the message in its place.
void ServerRole::count_shared(Traffic kind, std::size_t records, std::size_t bytes_each) noexcept {
  TrafficReport& traffic = report().traffic[static_cast<std::size_t>(kind)];
  ++traffic.messages;
  traffic.records += records;
  traffic.bytes += records * bytes_each;
}

void ServerRole::receive(Party& party, const MessageView& message) {
  add(report().traffic, message.header());
  const bool node = party.self.is_node();
  const bool tests = message.type() == MessageType::collision || message.type() == MessageType::narrow_done;
  if (node && tests && message.header().epoch != map_.epoch()) {
    return;  // what it found before a loss was known; it will find it again
  }
  switch (message.type()) {
    case MessageType::state_update:
      // Poses are frozen once a host has said its last word: what comes later would reach some nodes and not others.
      return node || party.states_heard ? refuse(party, Status::bad_message) : hear_states(party, message);
    case MessageType::node_state:
      return node ? hear_node_states(party, message) : refuse(party, Status::bad_message);
    case MessageType::collision:
      return node ? hear_collisions(party, message) : refuse(party, Status::bad_message);
    case MessageType::narrow_done:
      return node && message.count() == 1 ? hear_tested(party, message) : refuse(party, Status::bad_message);
    case MessageType::here:
      return node ? void() : refuse(party, Status::bad_message);
    case MessageType::kinds:
      return node ? hear_kinds(message) : refuse(party, Status::bad_message);
    case MessageType::told:
      // Believed once, and not before the sender can have heard what it says that it has dealt with.
      return message.count() == 1 && !party.told_heard && (stage_ == Stage::notifying || stage_ == Stage::closing)
                 ? hear_told(party, message)
                 : refuse(party, Status::bad_message);
    default:
      return refuse(party, Status::bad_message);
  }
}

// M1. A user node may lie: what it says is taken for an object only if it hosts it and the pose can stand.
void ServerRole::hear_states(Party& party, const MessageView& message) {
  const std::uint64_t start = telemetry::now_ns();
  for (std::size_t i = 0; i < message.count(); ++i) {
    auto record = message.record<messages::StateRecord>(i);
    if (setup_.quotas.updates != 0 && ++party.heard_updates > setup_.quotas.updates) {
      refuse(party, Status::over_quota, record.object.number);
      continue;
    }
    const std::uint32_t slot = objects_.find(record.object);
    if (slot == NumberIndex::none) {
      refuse(party, Status::stale_object, record.object.number);
      continue;
    }
    ObjectRow& row = objects_.row(slot);
    if (objects_.host(slot) != party.self) {
      refuse(party, Status::not_host, record.object.number);
      continue;
    }
    if (const Status status = make_valid(record.pose); status != Status::ok) {
      refuse(party, status, record.object.number);
      continue;
    }
    row.pose = record.pose;
    row.object.flags = record.object.flags & messages::flag_present;
    objects_.bounds(slot) = setup_.shapes->bounds(row.shape, row.pose, *setup_.space);
    std::copy_n(message.state<messages::StateRecord>(i), objects_.state_bytes(), objects_.state(slot));
    objects_.mark_moved(slot);
  }
  party.states_heard |= message.last();
  ingest_ns_ += telemetry::now_ns() - start;
}

void ServerRole::hear_node_states(Party& party, const MessageView& message) {
  const std::uint64_t start = telemetry::now_ns();
  constexpr std::size_t ahead = 12;
  const bool sweeps = setup_.placement == Placement::server;
  for (std::size_t i = 0; i < message.count(); ++i) {
    if (i + ahead < message.count()) {
      const auto& soon = message.view<messages::ObjectRef>(i + ahead);
      objects_.fetch(soon.slot, sweeps || (soon.flags & messages::flag_inner) == 0);
    }
    if (i + 2 * ahead < message.count()) {
      __builtin_prefetch(message.at(i + 2 * ahead));
      __builtin_prefetch(message.at(i + 2 * ahead) + 64);
    }
    const auto& record = message.view<messages::NodeStateRecord>(i);
    const std::uint32_t slot = objects_.find(record.object);
    if (slot == NumberIndex::none || objects_.host(slot) != party.self) {
      refuse(party, slot == NumberIndex::none ? Status::stale_object : Status::not_host, record.object.number);
      continue;
    }
    ObjectRow& row = objects_.row(slot);
    row.pose = record.pose;
    row.object.flags = record.object.flags & messages::flag_present;
    const bool inner = (record.object.flags & messages::flag_inner) != 0;
    std::uint8_t& marks = objects_.marks(slot);
    marks |= static_cast<std::uint8_t>(reported_mark | (inner ? inner_mark : 0));
    if ((record.object.flags & messages::flag_staying) == 0) {
      leaving_.push_back(slot);
    }
    std::copy_n(message.state<messages::NodeStateRecord>(i), objects_.state_bytes(), objects_.state(slot));
    const bool host_alone = inner && (marks & shared_mark) == 0;  // knows where it is: there is nobody to tell
    if (sweeps || !host_alone) {
      objects_.bounds(slot) = record.bounds;
    } else {
      bounds_are_stale_ = true;  // a line less a state; they follow from the pose when somebody asks
    }
    if (host_alone) {
      marks |= told_mark;
      objects_.mark_moved_alone(slot);
    } else {
      objects_.mark_moved(slot);
    }
  }
  party.states_heard |= message.last();
  ingest_ns_ += telemetry::now_ns() - start;
}

void ServerRole::hear_collisions(Party& party, const MessageView& message) {
  const auto numbers = objects_.numbers();
  for (std::size_t i = 0; i < message.count(); ++i) {
    const auto& record = message.view<messages::CollisionRecord>(i);
    ledger_.receive(party.self.number(), ContactOrder::key(numbers[record.slot_a], numbers[record.slot_b]), record);
  }
}

// A node's results count only whole: when it says how many pairs it tested, and all its contacts are here.
void ServerRole::hear_tested(Party& party, const MessageView& message) {
  const auto record = message.record<messages::NarrowDoneRecord>(0);
  NodeReport& node = report().nodes[party.self.number()];
  node.candidates = record.candidates;
  node.tested = record.tested;
  node.contacts = record.contacts;
  report().tested += record.tested;
  if (Findings* const findings = party.line.findings) {
    ledger_.receive(party.self.number(), *findings);
    count_shared(Traffic::m3, findings->keys.size(), sizeof(messages::CollisionRecord));
  }
  if (ledger_.received(party.self.number()) == record.contacts) {
    report().accepted += record.tested;
  } else {
    refuse(party, Status::bad_message);
  }
  if (setup_.placement == Placement::region) {
    report().candidates += record.candidates;
  }
  party.tested_heard = true;
}

void ServerRole::hear_kinds(const MessageView& message) {
  auto& kinds = report().kinds;
  for (std::size_t i = 0; i < message.count(); ++i) {
    const auto record = message.record<messages::KindRecord>(i);
    const auto first = static_cast<ShapeKind>(record.first);
    const auto second = static_cast<ShapeKind>(record.second);
    auto at = std::find_if(kinds.begin(), kinds.end(),
                           [&](const KindReport& kind) { return kind.first == first && kind.second == second; });
    if (at == kinds.end()) {
      at = kinds.emplace(kinds.end());
      at->first = first;
      at->second = second;
    }
    at->candidates += record.candidates;
    at->hits += record.hits;
    at->lanes += record.lanes;
    at->lanes_filled += record.lanes_filled;
    at->iterations += record.iterations;
    at->ended_early += record.ended_early;
    at->timed += record.timed;
    at->nanoseconds += record.nanoseconds;
    at->gather_nanoseconds += record.gather_nanoseconds;
    for (std::size_t k = 0; k < cost_buckets; ++k) at->cost[k] += record.cost[k];
  }
}

void ServerRole::hear_told(Party& party, const MessageView& message) {
  const auto record = message.record<messages::ToldRecord>(0);
  FrameReport& frame = report();
  frame.refused[static_cast<std::size_t>(Status::model_failed)] += record.model_failed;
  frame.refused[static_cast<std::size_t>(Status::not_finite)] += record.not_finite;
  frame.refused[static_cast<std::size_t>(Status::not_unit)] += record.not_unit;
  if (party.self.is_node()) {
    NodeReport& node = frame.nodes[party.self.number()];
    node.busy_ms = telemetry::to_ms(record.busy_ns);
    node.cpu_ms = telemetry::to_ms(record.cpu_ns);
    node.move_ms = telemetry::to_ms(record.move_ns);
    node.broad_phase_ms = telemetry::to_ms(record.broad_phase_ns);
    node.narrow_phase_ms = telemetry::to_ms(record.narrow_phase_ns);
    PathReport& path = frame.path;
    path.node_move_ms = std::max(path.node_move_ms, telemetry::to_ms(record.move_cpu_ns));
    path.node_detect_ms = std::max(path.node_detect_ms, telemetry::to_ms(record.detect_cpu_ns));
    path.node_end_ms =
        std::max(path.node_end_ms, telemetry::to_ms(record.cpu_ns - record.move_cpu_ns - record.detect_cpu_ns));
    node.hosted = record.hosted;
    node.handed_over = record.handed_over;
    TrafficReport& m5 = frame.traffic[static_cast<std::size_t>(Traffic::m5)];
    m5.messages += record.m5_messages;
    m5.records += record.handed_over;
    m5.bytes += record.m5_bytes;
  } else {
    frame.path.user_move_ms += telemetry::to_ms(record.move_ns);
    frame.path.user_look_ms += telemetry::to_ms(record.busy_ns);
    // Every user node also tells the others, once: the publication.
    TrafficReport& m1 = frame.traffic[static_cast<std::size_t>(Traffic::m1)];
    m1.records += record.published;
    m1.bytes += record.published * sizeof(link::PublishedState);
  }
  party.told_heard = true;
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

void ServerRole::refresh_bounds() {
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
  if (tell_everything_) {
    refresh_bounds();
  }
  dispatch_.list_updates(objects_, map_, tell_everything_);
  tell_everything_ = false;
  dispatch_.start();
}

void ServerRole::collect() {
  spend(ringfence::Stage::narrow_phase, telemetry::now_ns());
  const std::uint64_t doubled = ledger_.merge();
  const bool map_may_change = wants_map();
  // Of what only its finder is to be told, the server need not know more than that it is there.
  const bool all = setup_.deployment != Deployment::user_collision || map_may_change || rescan_hosts_;
  ledger_.write(objects_.rows(), all);
  FrameReport& frame = report();
  frame.accepted += doubled;  // shows as accepted != tested: never silently
  frame.contacts = ledger_.live();
  frame.began = ledger_.began();
  frame.ended = ledger_.ended(frame_).size();
  spend(ringfence::Stage::collect, telemetry::now_ns());
  if (map_may_change) {
    draw_map();
  }
  next_hosts();
  list_notices();
}

// One transition of the frame; false where it has to wait.
bool ServerRole::advance() { return (!losses_to_tell_ || tell_losses()) && advance_stage(); }

bool ServerRole::advance_stage() {
  switch (stage_) {
    case Stage::waiting:
      return false;
    case Stage::opening:
      if (!all_parties([&](Party& party) { return open(party); })) {
        return false;
      }
      spend_cpu(&PathReport::open_ms);
      move_own();
      stage_ = Stage::moving;
      return true;
    case Stage::moving:
      if (!all_parties([](const Party& party) { return party.states_heard; })) {
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
      if (!std::all_of(nodes_.begin(), nodes_.end(),
                       [](const Party& node) { return node.lost || node.tested_heard; })) {
        return false;
      }
      spend_cpu(&PathReport::hear_ms);
      collect();
      spend_cpu(&PathReport::collect_ms);
      notify_ns_ = mark_ns_;
      stage_ = Stage::notifying;
      return true;
    case Stage::notifying:
      if (!all_parties([&](Party& party) { return notify(party); })) {
        return false;
      }
      stage_ = Stage::closing;
      return true;
    case Stage::closing:
      if (!all_parties([](const Party& party) { return party.told_heard; })) {
        return false;
      }
      finish();
      return false;
  }
  return false;
}

void ServerRole::finish() {
  if (!report().lost.empty()) {
    ledger_.take_over(report().lost);
  }
  const std::uint64_t now = telemetry::now_ns();
  spend(ringfence::Stage::notify, now);
  spend_cpu(&PathReport::notify_ms);
  FrameReport& frame = report();
  frame.objects = objects_.live();
  frame.map_epoch = map_.epoch();
  frame.moved = objects_.moved().size();
  frame.frame_ms = telemetry::to_ms(now - begin_ns_);
  frame.server_cpu_ms = telemetry::to_ms(telemetry::thread_cpu_ns() - cpu_begin_ns_);
  for (NodeReport& node : frame.nodes) {
    node.wait_ms = std::max(0.0, frame.frame_ms - node.busy_ms);
  }
  frame.grown = (objects_.slots() > setup_.capacities.objects ? 1u : 0u) +
                (frame.candidates > setup_.capacities.pairs ? 1u : 0u) +
                (frame.contacts > setup_.capacities.contacts ? 1u : 0u);
  tell_everything_ = map_changed_;
  map_changed_ = rescan_hosts_ = map_first_ = false;
  stage_ = Stage::waiting;
  setup_.order->completed.store(frames_, std::memory_order_release);
  if (setup_.order->caller != nullptr) {
    setup_.order->caller->ring();
  }
}

}  // namespace ringfence::nodes
