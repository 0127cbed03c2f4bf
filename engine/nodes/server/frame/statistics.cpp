#include "nodes/server/frame/statistics.hpp"

#include <algorithm>
#include <utility>

#include "telemetry/clock.hpp"
#include "telemetry/track.hpp"

namespace ringfence::nodes {

void Statistics::begin() {
  state_.begin_ns = mark_ns_ = telemetry::now_ns();
  cpu_begin_ns_ = cpu_mark_ns_ = telemetry::working_cpu_ns();
  ingest_ns_ = 0;
  FrameReport& frame = state_.report();
  std::vector<NodeReport> nodes = std::move(frame.nodes);
  std::vector<KindReport> kinds = std::move(frame.kinds);
  nodes.clear();
  kinds.clear();
  frame = {};
  frame.nodes = std::move(nodes);
  frame.kinds = std::move(kinds);
  frame.frame = state_.frame;
  state_.model_failures.clear();
}

void Statistics::list_nodes() {
  FrameReport& frame = state_.report();
  for (PeerSession& session : state_.nodes) {
    if (session.connected) {
      session.in_report = frame.nodes.size();
      frame.nodes.emplace_back().id = NodeId(session.id);
    }
  }
}

void Statistics::forget_results() {
  FrameReport& frame = state_.report();
  frame.candidates = frame.tested = frame.carried = frame.accepted = frame.failed_supports = 0;
  for (NodeReport& node : frame.nodes) {
    node = {.id = node.id};
  }
}

void Statistics::finish(std::uint64_t moved) {
  const std::uint64_t now = telemetry::now_ns();
  charge(Stage::notify, now);
  charge_cpu(&PathReport::finish_ms);
  FrameReport& frame = state_.report();
  const Capacities& capacities = state_.setup.capacities;
  frame.objects = state_.objects.live();
  frame.map_epoch = state_.map.epoch();
  frame.moved = moved;
  frame.frame_ms = telemetry::to_ms(now - state_.begin_ns);
  frame.server_cpu_ms = telemetry::to_ms(telemetry::working_cpu_ns() - cpu_begin_ns_);
  for (NodeReport& node : frame.nodes) {
    node.wait_ms = std::max(0.0, frame.frame_ms - node.busy_ms);
  }
  frame.grown = (state_.objects.slots() > capacities.objects ? 1u : 0u) +
                (frame.candidates > capacities.pairs ? 1u : 0u) +
                (frame.contacts + frame.unlisted > capacities.contacts ? 1u : 0u);
}

void Statistics::charge(Stage stage, std::uint64_t now) noexcept {
  const std::uint64_t passed = now - mark_ns_;
  const std::uint64_t ingest = std::min(ingest_ns_, passed);
  state_.report().stage_ms[static_cast<std::size_t>(stage)] += telemetry::to_ms(passed - ingest);
  state_.report().stage_ms[static_cast<std::size_t>(Stage::ingest)] += telemetry::to_ms(ingest);
  if (state_.setup.track != nullptr) {
    state_.setup.track->add(name_of(stage), mark_ns_, now);
  }
  mark_ns_ = now;
  ingest_ns_ = 0;
}

void Statistics::charge(Stage stage) noexcept { charge(stage, telemetry::now_ns()); }

void Statistics::charge_cpu(double PathReport::*step) noexcept {
  const std::uint64_t now = telemetry::working_cpu_ns();
  state_.report().path.*step += telemetry::to_ms(now - cpu_mark_ns_);
  cpu_mark_ns_ = now;
}

// A member of the wake tree starts when it has been rung and has rung others. The server's own rings, at the end of its
// step, are the first of the rings in turn.
void Statistics::charge_woken(double step_ms, PeerSession::Reached PeerSession::*reached) noexcept {
  const link::WakeOrder& order = state_.wake_tree->order();
  const double served_ms = step_ms - state_.rings_ms, ring_ms = state_.rings_ms / order.waker.count;
  std::size_t member = 0;
  for (PeerSession& node : state_.nodes) {
    if (node.connected) {
      (node.*reached).ms = served_ms + order.rings_in_turn[member++] * ring_ms;
    }
  }
}

bool Statistics::note_reached(PeerSession::Reached& reached) noexcept {
  reached.ns = reached.ns != 0 ? reached.ns : telemetry::now_ns();
  return true;
}

void Statistics::charge_reached(double step_ms, std::uint64_t begin_ns,
                                PeerSession::Reached PeerSession::*reached) noexcept {
  if (state_.is_waking()) {
    return charge_woken(step_ms, reached);
  }
  const double passed = static_cast<double>(telemetry::now_ns() - begin_ns);
  for (PeerSession& node : state_.nodes) {
    const double until = static_cast<double>((node.*reached).ns - begin_ns);
    const bool noted = (node.*reached).ns != 0 && !node.lost && passed > 0;
    (node.*reached).ms = noted ? step_ms * until / passed : step_ms;
  }
}

void Statistics::count(const messages::Header& header) noexcept {
  const auto type = static_cast<messages::MessageType>(header.type);
  TrafficReport& traffic = state_.report().traffic[static_cast<std::size_t>(traffic_of(type))];
  ++traffic.messages;
  traffic.records += header.count;
  traffic.bytes += header.bytes;
}

void Statistics::count_report(messages::MessageType type, std::size_t records, std::size_t bytes_each) noexcept {
  messages::Header header;
  header.type = static_cast<std::uint16_t>(type);
  header.count = static_cast<std::uint32_t>(records);
  header.bytes = static_cast<std::uint32_t>(sizeof header + records * bytes_each);
  count(header);
}

void Statistics::count_shared(Traffic kind, std::size_t records, std::size_t bytes_each) noexcept {
  TrafficReport& traffic = state_.report().traffic[static_cast<std::size_t>(kind)];
  ++traffic.messages;
  traffic.records += records;
  traffic.bytes += records * bytes_each;
}

void Statistics::add(const PeerSession& node, const messages::NarrowDoneRecord& done) noexcept {
  FrameReport& frame = state_.report();
  NodeReport& entry = frame.nodes[node.in_report];
  entry.candidates = done.candidates;
  entry.tested = done.tested;
  entry.carried = done.carried;
  entry.contacts = done.contacts;
  entry.failed_supports = done.failed_supports;
  frame.failed_supports += done.failed_supports;
  frame.tested += done.tested;
  frame.carried += done.carried;
  if (state_.setup.placement == Placement::region) {
    frame.candidates += done.candidates;
  }
}

void Statistics::add_refusals(const messages::NodeFrameStats& stats) noexcept {
  auto& refused = state_.report().refused;
  refused[static_cast<std::size_t>(Status::model_failed)] += stats.model_failed;
  refused[static_cast<std::size_t>(Status::not_finite)] += stats.not_finite;
  refused[static_cast<std::size_t>(Status::not_unit)] += stats.not_unit;
}

// User nodes also send their states to each other, once: the publication.
void Statistics::add_users(const messages::NodeFrameStats& stats) noexcept {
  add_refusals(stats);
  TrafficReport& m1 = state_.report().traffic[static_cast<std::size_t>(Traffic::m1)];
  m1.records += stats.published;
  m1.bytes += stats.published * sizeof(PublishedState);
}

void Statistics::add(const PeerSession& session, const messages::NodeFrameStats& stats) noexcept {
  add_refusals(stats);
  FrameReport& frame = state_.report();
  NodeReport& node = frame.nodes[session.in_report];
  node.busy_ms = telemetry::to_ms(stats.busy_ns);
  node.cpu_ms = telemetry::to_ms(stats.cpu_ns);
  node.move_ms = telemetry::to_ms(stats.move_ns);
  node.broad_phase_ms = telemetry::to_ms(stats.broad_phase_ns);
  node.narrow_phase_ms = telemetry::to_ms(stats.narrow_phase_ns);
  node.hosted = stats.hosted;
  node.handed_over = stats.handed_over;
  node.query_ms = telemetry::to_ms(stats.query_ns);
  node.query_boxes = stats.query_boxes;
  node.query_tests = stats.query_tests;
  frame.queries.boxes += stats.query_boxes;
  frame.queries.tests += stats.query_tests;
  frame.queries.failed_supports += stats.query_failed_supports;
  charge_path(session, stats);
  if (stats.host_owned_changes != 0) {
    count_shared(Traffic::state, stats.host_owned_changes,
                 sizeof(messages::NodeStateRecord) + state_.objects.state_bytes());
  }
  TrafficReport& m5 = frame.traffic[static_cast<std::size_t>(Traffic::m5)];
  m5.messages += stats.m5_messages;
  m5.records += stats.handed_over;
  m5.bytes += stats.m5_bytes;
}

void Statistics::charge_path(const PeerSession& node, const messages::NodeFrameStats& stats) noexcept {
  PathReport& path = state_.report().path;
  const auto raise = [](double& most, double ms) { most = std::max(most, ms); };
  const double move_ms = telemetry::to_ms(stats.move_cpu_ns);
  const double publish_ms = telemetry::to_ms(stats.publish_cpu_ns);
  const double detect_ms = telemetry::to_ms(stats.detect_cpu_ns);
  const double end_ms = telemetry::to_ms(stats.cpu_ns) - move_ms - publish_ms - detect_ms;
  raise(path.node_move_ms, move_ms);
  raise(path.node_publish_ms, publish_ms);
  raise(path.node_detect_ms, detect_ms);
  raise(path.node_end_ms, end_ms);
  NodeReport& report = state_.report().nodes[node.in_report];
  report.moved_ms = node.started.ms + move_ms;
  report.tested_ms = std::max(node.dispatched.ms, publish_ms) + detect_ms;
  report.ended_ms = node.notified.ms + end_ms;
  raise(path.nodes_moved_ms, report.moved_ms);
  raise(path.nodes_tested_ms, report.tested_ms);
  raise(path.nodes_ended_ms, report.ended_ms);
}

void Statistics::add(const messages::KindRecord& record) {
  auto& kinds = state_.report().kinds;
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
  if (record.timed == 0) {  // only a sample of the pairs is timed: usually none of a node with few pairs
    return;
  }
  at->timed += record.timed;
  at->nanoseconds += record.nanoseconds;
  at->gather_nanoseconds += record.gather_nanoseconds;
  for (std::size_t k = 0; k < cost_buckets; ++k) at->cost[k] += record.cost[k];
}

}  // namespace ringfence::nodes
