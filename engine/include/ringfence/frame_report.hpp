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

/// The stages of a frame, as seen by the server, in order. Their times add up to the frame.
enum class Stage : std::uint8_t { move, ingest, broad_phase, dispatch, narrow_phase, collect, notify };
inline constexpr std::size_t stage_count = 7;
constexpr const char* name_of(Stage stage) noexcept {
  constexpr const char* names[] = {"move", "ingest", "broad_phase", "dispatch", "narrow_phase", "collect", "notify"};
  return names[static_cast<std::size_t>(stage)];
}

/// What one CD node did in a frame.
struct NodeReport {
  double busy_ms = 0;  ///< wall time in which its role made progress
  double cpu_ms = 0;   ///< CPU time of its thread (with nodes = 0: as busy_ms)
  double wait_ms = 0;  ///< frame time less busy time
  double move_ms = 0;
  double broad_phase_ms = 0;
  double narrow_phase_ms = 0;
  std::uint64_t candidates = 0;  ///< pairs that it owns
  std::uint64_t tested = 0;
  std::uint64_t contacts = 0;
  std::uint64_t hosted = 0;       ///< objects that it hosts after the frame
  std::uint64_t handed_over = 0;  ///< objects that it sent to other nodes
};

/// The buckets of KindReport::cost. Bucket i counts what cost from 2^(i/2) to 2^((i+1)/2) ns a candidate; the first
/// also what cost less than 1 ns, the last (from 0.74 ms) also what cost more.
inline constexpr std::size_t cost_buckets = 40;

/// What the narrow phase did with the pairs of two kinds of shapes, all nodes together. Times are those of a sample of
/// the candidates, without the time of looking at the clock.
struct KindReport {
  ShapeKind first = ShapeKind::sphere;  ///< in the order of ShapeKind
  ShapeKind second = ShapeKind::sphere;
  std::uint64_t candidates = 0;
  std::uint64_t hits = 0;
  std::uint64_t lanes = 0;         ///< vector lanes spent, idle ones included; 0 where a kernel is not in lanes
  std::uint64_t lanes_filled = 0;  ///< of them, those that worked on a pair or on a part of one: a face, a triangle
  /// Steps of searches: directions judged for hulls; for meshes, nodes of the tree that were looked into and triangles
  /// that were judged exactly, for two meshes pairs of them; 0 for closed forms.
  std::uint64_t iterations = 0;
  std::uint64_t ended_early = 0;         ///< candidates that an axis remembered from an earlier frame proved apart
  std::uint64_t timed = 0;               ///< candidates that were timed
  std::uint64_t nanoseconds = 0;         ///< in the kernels for those, gathering included
  std::uint64_t gather_nanoseconds = 0;  ///< of them, reading bodies and shapes into the kernel's form
  std::array<std::uint64_t, cost_buckets> cost{};  ///< the timed candidates by their nanoseconds
};

/// Messages and bytes by what they carry.
enum class Traffic : std::uint8_t { m1, m2, m3, m4, m5, state, control };
inline constexpr std::size_t traffic_count = 7;
struct TrafficReport {
  std::uint64_t messages = 0;
  std::uint64_t records = 0;
  std::uint64_t bytes = 0;
};

/// What the steps of a frame cost, in CPU time, each after the one above it; of what is done by many at once, what it
/// cost the one that it cost most. Between two empty lines stands what is done at the same time, by the server, the
/// nodes and the users. With nodes = 0 all zero.
struct PathReport {
  double start_nodes_ms = 0;  ///< server: the cut, telling nodes that the frame begins

  double start_users_ms = 0;  ///< server: telling users that it begins, before they move
  double ingest_ms = 0;       ///< server: from then until it has all states
  double node_move_ms = 0;    ///< nodes
  double user_move_ms = 0;    ///< users

  double dispatch_ms = 0;      ///< server: what moved, its sweep
  double node_publish_ms = 0;  ///< nodes: what they host

  double publish_ms = 0;      ///< server: what nobody else publishes, telling users to look
  double node_detect_ms = 0;  ///< nodes: until they have told their contacts
  double user_read_ms = 0;    ///< users, when they are told to
  double plan_map_ms = 0;     ///< server: a step towards a region map that follows the load

  double receive_contacts_ms = 0;  ///< server: taking in what nodes found
  double collect_ms = 0;           ///< server: merging, phases, who is told of what
  double notify_ms = 0;            ///< server: telling nodes

  double notify_users_ms = 0;       ///< server: telling users, before they end
  double node_end_ms = 0;           ///< nodes: putting contacts in order, handing over
  double user_end_ms = 0;           ///< users: taking in what they are told
  double receive_user_acks_ms = 0;  ///< server: hearing that users have ended

  double finish_ms = 0;  ///< server: hearing that nodes have ended

  // The busiest node of a step need not be that of the next, and nodes are told one after another. So of the steps that
  // a node takes without hearing of others between them, what they take together, for the node that is done last. The
  // time at which a node is told is estimated: as much of the server's step as had passed by the clock.
  double nodes_moved_ms = 0;   ///< from the begin of open: until it is told, and its move
  double nodes_tested_ms = 0;  ///< from the begin of dispatch: the longer of that and its publishing, and its tests
  double nodes_ended_ms = 0;   ///< from the begin of notify: until it is told, and its end

  static constexpr std::size_t steps = 22;
  using Step = std::pair<const char*, double PathReport::*>;
  /// All of the above by their names, in their order.
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

  /// The least time of the frame with a core for each thread, but for the way of messages: of what is done at the same
  /// time the longest counts. What may or may not overlap, as nodes' tests and the server's sweep, is added up; but
  /// users end as they are told, one after another.
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

/// One thing that a thread did in a frame; see WorldConfig::timeline.
struct TimelineSpan {
  std::uint32_t track = 0;     ///< 0: the server; 1 to nodes: the CD nodes; then the user threads, in order
  const char* name = nullptr;  ///< a literal
  std::uint64_t begin_ns = 0;  ///< of the machine's monotonic clock
  std::uint64_t end_ns = 0;
};

/// What a frame did and cost. Times in milliseconds of wall time.
struct FrameReport {
  std::uint64_t frame = 0;
  double frame_ms = 0;
  std::array<double, stage_count> stage_ms{};
  std::uint64_t candidates = 0;  ///< pairs that the layers allow and whose bounds touch, as assigned to nodes
  std::uint64_t tested = 0;      ///< pairs tested, as the nodes report; differs from candidates only by a bug or a loss
  std::uint64_t accepted = 0;    ///< pairs whose result (contact or none) the server accepted
  std::uint64_t contacts = 0;    ///< begin and persist
  std::uint64_t began = 0, ended = 0;
  std::uint64_t objects = 0, moved = 0;
  std::uint64_t handed_over = 0;  ///< objects whose host changed
  std::uint32_t map_epoch = 1;    ///< of the region map for the next frame: grows when regions were balanced or resized
  std::array<std::uint64_t, status_count> refused{};  ///< calls and records refused, by reason
  std::array<TrafficReport, traffic_count> traffic{};
  std::uint64_t grown = 0;  ///< buffers that outgrew what was reserved
  double server_cpu_ms = 0;
  double users_cpu_ms = 0;         ///< all user threads together
  double slowest_user_cpu_ms = 0;  ///< the user thread that used most
  PathReport path;
  /// CD nodes that stopped answering in this frame, by their numbers in it. Their work was done by the others; from the
  /// next frame on the nodes above them are numbered one lower each.
  std::vector<NodeNumber> lost;
  std::vector<UserNumber> late;  ///< user nodes that missed their deadline; disconnected at the next cut
  std::vector<NodeReport> nodes;
  std::vector<KindReport> kinds;       ///< pairs of kinds that had candidates
  std::vector<TimelineSpan> timeline;  ///< empty unless WorldConfig::timeline is set
};

}  // namespace ringfence
