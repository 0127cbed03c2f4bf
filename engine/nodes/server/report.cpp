// The server's report of a frame: costs of its steps, and traffic.
#include <algorithm>
#include <utility>

#include "nodes/server/server_role.hpp"
#include "telemetry/clock.hpp"
#include "telemetry/track.hpp"

namespace ringfence::nodes {

using messages::MessageType;

void ServerRole::start_report() {
  FrameReport& frame = state_.report();
  std::vector<NodeReport> nodes = std::move(frame.nodes);
  std::vector<KindReport> kinds = std::move(frame.kinds);
  nodes.clear();
  kinds.clear();
  frame = {};
  frame.nodes = std::move(nodes);
  frame.kinds = std::move(kinds);
  frame.frame = state_.frame;
}

// By ascending slot.
void ServerRole::list_nodes() {
  FrameReport& frame = state_.report();
  for (PeerSession& session : state_.nodes) {
    if (session.connected) {
      session.in_report = frame.nodes.size();
      frame.nodes.emplace_back().id = NodeId(session.id);
    }
  }
}

// Charges the time since the last call to a stage of the report, except the part that ingest took.
void ServerRole::spend(Stage stage, std::uint64_t now) noexcept {
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

void ServerRole::spend_cpu(double PathReport::*step) noexcept {
  const std::uint64_t now = telemetry::thread_cpu_ns();
  state_.report().path.*step += telemetry::to_ms(now - cpu_mark_ns_);
  cpu_mark_ns_ = now;
}

// Sets the time if it is not set yet.
bool ServerRole::note_first(PeerSession::Reached& reached) noexcept {
  reached.ns = reached.ns != 0 ? reached.ns : telemetry::now_ns();
  return true;
}

// For a step in which nodes are notified one after another: estimates its cost up to the notification of each.
void ServerRole::charge_notified(double step_ms, std::uint64_t begin_ns,
                                 PeerSession::Reached PeerSession::*reached) noexcept {
  const double passed = static_cast<double>(telemetry::now_ns() - begin_ns);
  for (PeerSession& node : state_.nodes) {
    const double until = static_cast<double>((node.*reached).ns - begin_ns);
    (node.*reached).ms = node.lost || passed <= 0 ? step_ms : step_ms * until / passed;
  }
}

void ServerRole::charge_path(const PeerSession& node, const messages::NodeFrameStats& stats) noexcept {
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
  raise(path.nodes_moved_ms, node.started.ms + move_ms);
  raise(path.nodes_tested_ms, std::max(path.dispatch_ms, publish_ms) + detect_ms);
  raise(path.nodes_ended_ms, node.notified.ms + end_ms);
}

void ServerRole::add(messages::TrafficCounts& counts, const messages::Header& header) noexcept {
  TrafficReport& traffic = counts[static_cast<std::size_t>(traffic_of(static_cast<MessageType>(header.type)))];
  ++traffic.messages;
  traffic.records += header.count;
  traffic.bytes += header.bytes;
}

// Data that is read in shared memory counts like the message that it replaces.
void ServerRole::count_shared(Traffic kind, std::size_t records, std::size_t bytes_each) noexcept {
  TrafficReport& traffic = state_.report().traffic[static_cast<std::size_t>(kind)];
  ++traffic.messages;
  traffic.records += records;
  traffic.bytes += records * bytes_each;
}

}  // namespace ringfence::nodes
