#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <utility>
#include <vector>

#include "ringfence/ids.hpp"
#include "ringfence/shape.hpp"
#include "ringfence/status.hpp"

namespace ringfence {

/// The stages of a frame as the server measures them, in order. Their times add up to the time of the frame.
enum class Stage : std::uint8_t { move, ingest, broad_phase, dispatch, narrow_phase, collect, notify };
inline constexpr std::size_t stage_count = 7;
constexpr const char* name_of(Stage stage) noexcept {
  constexpr const char* names[] = {"move", "ingest", "broad_phase", "dispatch", "narrow_phase", "collect", "notify"};
  return names[static_cast<std::size_t>(stage)];
}

/// Work of one CD node in one frame.
struct NodeReport {
  double busy_ms = 0;  ///< wall time in which the role made progress
  double cpu_ms = 0;   ///< CPU time of the node's thread (with nodes = 0: same as busy_ms)
  double wait_ms = 0;  ///< frame time minus busy time
  double move_ms = 0;
  double broad_phase_ms = 0;
  double narrow_phase_ms = 0;
  std::uint64_t candidates = 0;  ///< pairs that the node owns
  std::uint64_t tested = 0;
  std::uint64_t contacts = 0;
  std::uint64_t failed_supports = 0;  ///< pairs without a contact because a support function failed
  std::uint64_t hosted = 0;           ///< objects that the node hosts after the frame
  std::uint64_t handed_over = 0;      ///< objects that the node handed over to others
};

/// Buckets of KindReport::cost. Bucket i counts candidates that cost 2^(i/2) to 2^((i+1)/2) ns. The first also counts
/// those below 1 ns, the last (from 0.74 ms) also those above its range.
inline constexpr std::size_t cost_buckets = 40;

/// Work of the narrow phase for one pair of shape kinds, all nodes together. Times are those of a sample of the
/// candidates, without the cost of reading the clock.
struct KindReport {
  ShapeKind first = ShapeKind::sphere;  ///< first <= second in the order of ShapeKind
  ShapeKind second = ShapeKind::sphere;
  std::uint64_t candidates = 0;
  std::uint64_t hits = 0;
  std::uint64_t lanes = 0;         ///< vector lanes used, idle ones included; 0 for kernels that do not use lanes
  std::uint64_t lanes_filled = 0;  ///< lanes that worked on a pair, or on a part of one such as a face or triangle
  /// Search steps. Hulls: directions evaluated. Meshes: tree nodes visited and triangles tested exactly; for two
  /// meshes, pairs of them. Closed forms: 0.
  std::uint64_t iterations = 0;
  std::uint64_t ended_early = 0;         ///< candidates proved apart by an axis remembered from an earlier frame
  std::uint64_t timed = 0;               ///< candidates that were timed
  std::uint64_t nanoseconds = 0;         ///< in the kernels for the timed candidates, gathering included
  std::uint64_t gather_nanoseconds = 0;  ///< part of nanoseconds: reading bodies and shapes into the kernel's layout
  std::array<std::uint64_t, cost_buckets> cost{};  ///< timed candidates by cost
};

/// Kinds of traffic. m1 to m5 are the paper's messages.
enum class Traffic : std::uint8_t { m1, m2, m3, m4, m5, state, control };
inline constexpr std::size_t traffic_count = 7;
struct TrafficReport {
  std::uint64_t messages = 0;
  std::uint64_t records = 0;
  std::uint64_t bytes = 0;
};

/// CPU time of the steps of a frame, in order. For steps that several threads do at once: that of the slowest. Steps
/// between two empty lines run concurrently on the server, the nodes and the users. All 0 with nodes = 0.
struct PathReport {
  double start_nodes_ms = 0;  ///< server: cut, send frame_begin to the nodes

  double start_users_ms = 0;  ///< server: send frame_begin to the users
  double ingest_ms = 0;       ///< server: from then until all states have arrived
  double node_move_ms = 0;    ///< nodes: move hosted objects
  double user_move_ms = 0;    ///< users: move hosted objects

  double dispatch_ms = 0;      ///< server: send updates to the nodes, sweep
  double node_publish_ms = 0;  ///< nodes: publish hosted objects

  double publish_ms = 0;      ///< server: publish what no other role publishes; allow users to read
  double node_detect_ms = 0;  ///< nodes: from then until their contacts are sent
  double user_read_ms = 0;    ///< users: read the publications of others
  double plan_map_ms = 0;     ///< server: one step towards a balanced region map

  double receive_contacts_ms = 0;  ///< server: receive the nodes' contacts
  double collect_ms = 0;           ///< server: merge contacts, compute phases, list the hosts to notify
  double notify_ms = 0;            ///< server: notify nodes

  double notify_users_ms = 0;       ///< server: notify users
  double node_end_ms = 0;           ///< nodes: write contacts in order, hand over
  double user_end_ms = 0;           ///< users: receive their contacts
  double receive_user_acks_ms = 0;  ///< server: receive acknowledgements of users

  double finish_ms = 0;  ///< server: receive end-of-frame reports of nodes

  // The slowest node of one step need not be that of the next, and nodes are notified one after another. So the
  // following figures add the steps that a node takes without waiting for other nodes, for the node that finishes last.
  // The CPU time at which a node is notified is estimated from the fraction of the server's step that had passed on the
  // clock.
  double nodes_moved_ms = 0;  ///< from the start of start_nodes: until the node is notified, plus its move
  /// From the start of dispatch: the longer of dispatch and the node's publishing, plus its tests.
  double nodes_tested_ms = 0;
  double nodes_ended_ms = 0;  ///< from the start of notify: until the node is notified, plus its end

  static constexpr std::size_t steps = 22;
  using Step = std::pair<const char*, double PathReport::*>;
  /// All fields above with their names, in order.
  static constexpr std::array<Step, steps> all() noexcept {
    return {{{"start_nodes", &PathReport::start_nodes_ms},
             {"start_users", &PathReport::start_users_ms},
             {"ingest", &PathReport::ingest_ms},
             {"node_move", &PathReport::node_move_ms},
             {"user_move", &PathReport::user_move_ms},
             {"dispatch", &PathReport::dispatch_ms},
             {"node_publish", &PathReport::node_publish_ms},
             {"publish", &PathReport::publish_ms},
             {"node_detect", &PathReport::node_detect_ms},
             {"user_read", &PathReport::user_read_ms},
             {"plan_map", &PathReport::plan_map_ms},
             {"receive_contacts", &PathReport::receive_contacts_ms},
             {"collect", &PathReport::collect_ms},
             {"notify", &PathReport::notify_ms},
             {"notify_users", &PathReport::notify_users_ms},
             {"node_end", &PathReport::node_end_ms},
             {"user_end", &PathReport::user_end_ms},
             {"receive_user_acks", &PathReport::receive_user_acks_ms},
             {"finish", &PathReport::finish_ms},
             {"nodes_moved", &PathReport::nodes_moved_ms},
             {"nodes_tested", &PathReport::nodes_tested_ms},
             {"nodes_ended", &PathReport::nodes_ended_ms}}};
  }

  /// Lower bound of the frame time with one core per thread, without message latency. Of concurrent steps the longest
  /// counts. Steps that may or may not overlap, such as the nodes' tests and the server's sweep, are added; users end
  /// one after another, as they are notified.
  double critical_ms() const noexcept {
    const auto longest = [](double p, double q) { return p > q ? p : q; };
    return longest(nodes_moved_ms, start_nodes_ms + start_users_ms + longest(ingest_ms, user_move_ms)) +
           longest(nodes_tested_ms,
                   longest(dispatch_ms, node_publish_ms) + publish_ms + longest(user_read_ms, plan_map_ms)) +
           receive_contacts_ms + collect_ms +
           longest(nodes_ended_ms, notify_ms + longest(notify_users_ms, user_end_ms) + receive_user_acks_ms) +
           finish_ms;
  }
};

/// One span of work of a thread in a frame; see WorldConfig::timeline.
struct TimelineSpan {
  std::uint32_t track = 0;     ///< 0: the server; then the CD nodes; then the user threads, in order
  const char* name = nullptr;  ///< a string literal
  std::uint64_t begin_ns = 0;  ///< of the machine's monotonic clock
  std::uint64_t end_ns = 0;
};

/// Results and cost of one frame. Times in milliseconds; wall time unless the name says cpu.
struct FrameReport {
  std::uint64_t frame = 0;
  double frame_ms = 0;
  std::array<double, stage_count> stage_ms{};
  /// Pairs that the layers allow and whose bounds overlap or touch, as assigned to nodes.
  std::uint64_t candidates = 0;
  /// Pairs tested, as reported by the nodes; differs from candidates only after a bug or a loss.
  std::uint64_t tested = 0;
  std::uint64_t accepted = 0;  ///< pairs whose result (contact or none) the server accepted
  std::uint64_t contacts = 0;  ///< begin and persist
  /// Of `tested`: pairs without a contact because a support function threw or returned an invalid point; see
  /// SupportFunction. The log has the reason.
  std::uint64_t failed_supports = 0;
  std::uint64_t began = 0, ended = 0;
  std::uint64_t objects = 0, moved = 0;
  std::uint64_t handed_over = 0;  ///< objects whose host changed
  /// Epoch of the region map for the next frame; grows when regions are balanced or the number of nodes changes.
  std::uint32_t map_epoch = 1;
  std::array<std::uint64_t, status_count> refused{};  ///< calls and records refused, by reason
  std::array<TrafficReport, traffic_count> traffic{};
  std::uint64_t grown = 0;  ///< number of buffers that outgrew their reservation
  double server_cpu_ms = 0;
  double users_cpu_ms = 0;         ///< all user threads together
  double slowest_user_cpu_ms = 0;  ///< the user thread that used most
  PathReport path;
  /// CD nodes lost in this frame, by their number in it. Other nodes did their work. From the next frame on, nodes with
  /// higher numbers have moved down to close the gaps.
  std::vector<NodeNumber> lost;
  std::vector<UserNumber> late;  ///< user nodes that missed a deadline; they are disconnected at the next cut
  std::vector<NodeReport> nodes;
  std::vector<KindReport> kinds;       ///< pairs of kinds that had candidates
  std::vector<TimelineSpan> timeline;  ///< empty unless WorldConfig::timeline is set; without lost nodes
};

}  // namespace ringfence
