#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <utility>

#include "ringfence/shape.hpp"

/// Where the time of a frame goes, for those who measure the library: the critical path, the timeline of the threads,
/// and the narrow phase by kinds of shapes. FrameReport holds them beside the figures for operation.
namespace ringfence {

/// CPU time of the steps of a frame, milliseconds, in order. If several threads do a step at once, the time is that of
/// the slowest thread. The fields form groups, separated by empty lines. Within a group the server, the nodes and the
/// users work concurrently, and each does its own steps in order. All 0 with nodes = 0. See docs/scaling.md.
struct PathReport {
  double start_nodes_ms = 0;  ///< server: cut, send frame_begin to the nodes

  double start_users_ms = 0;  ///< server: send frame_begin to the users
  double ingest_ms = 0;       ///< server: move the objects that it hosts, receive all states
  double node_move_ms = 0;    ///< nodes: move hosted objects
  double user_move_ms = 0;    ///< users: move hosted objects

  double dispatch_ms = 0;      ///< server: send updates to the nodes, sweep
  double node_publish_ms = 0;  ///< nodes: publish hosted objects

  double publish_ms = 0;      ///< server: publish what no other role publishes; allow users to read
  double node_detect_ms = 0;  ///< nodes: after node_publish, until their contacts are sent
  double user_read_ms = 0;    ///< users: read the publications of others
  double plan_map_ms = 0;     ///< server: list objects that change hosts; one step towards a balanced region map

  double receive_contacts_ms = 0;  ///< server: receive the nodes' contacts
  double collect_ms = 0;           ///< server: merge contacts, compute phases, list the hosts to notify
  double notify_ms = 0;            ///< server: notify nodes

  double notify_users_ms = 0;       ///< server: notify users
  double node_end_ms = 0;           ///< nodes: write contacts in order, hand over
  double user_end_ms = 0;           ///< users: receive their contacts
  double receive_user_acks_ms = 0;  ///< server: count the nodes' tests by kinds, receive acknowledgements of users

  double finish_ms = 0;  ///< server: receive end-of-frame reports of nodes

  // The slowest node of one step need not be the slowest node of the next, and nodes are notified one after another. So
  // each of the following times is a sum over the steps that a node does without waiting for other nodes, for the node
  // with the largest sum. The CPU time until a node is notified is an estimate: the server's step multiplied by the
  // fraction of its wall time that had passed by then. If nodes wake each other, it is the server's step and the rings
  // that follow each other.
  double nodes_moved_ms = 0;   ///< the part of start_nodes until the node is notified, plus its node_move
  double nodes_tested_ms = 0;  ///< the longer of the part of dispatch until the node is notified (all of it with
                               ///< Placement::server) and its node_publish, plus its node_detect
  double nodes_ended_ms = 0;   ///< the part of notify until the node is notified, plus its node_end

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

  /// Estimates the frame time if each thread had its own core and messages had no latency. Of concurrent steps the
  /// longest counts. Steps that may or may not overlap, such as the server's sweep and the nodes' tests, are added.
  /// Users end while the server notifies other users, so the longer of these two steps counts.
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

/// An interval in which a thread did one kind of work in a frame; see WorldConfig::timeline.
struct TimelineSpan {
  std::uint32_t track = 0;     ///< 0: the server; then the CD nodes by number; then the user threads
  const char* name = nullptr;  ///< what the thread did; a string literal
  std::uint64_t begin_ns = 0;  ///< time on the machine's monotonic clock
  std::uint64_t end_ns = 0;
};

/// Number of buckets of KindReport::cost. Bucket i counts candidates that cost 2^(i/2) to 2^((i+1)/2) ns. The first
/// bucket also counts cheaper candidates, the last one (from 0.74 ms) also more expensive ones.
inline constexpr std::size_t cost_buckets = 40;

/// Work of the narrow phase for one pair of shape kinds, all nodes together. Only a sample of the candidates is timed;
/// the cost of reading the clock is subtracted.
struct KindReport {
  ShapeKind first = ShapeKind::sphere;  ///< first <= second in the order of ShapeKind
  ShapeKind second = ShapeKind::sphere;
  std::uint64_t candidates = 0;    ///< pairs that were tested
  std::uint64_t hits = 0;          ///< candidates in contact
  std::uint64_t lanes = 0;         ///< vector lanes used, idle ones included; 0 for kernels that do not use lanes
  std::uint64_t lanes_filled = 0;  ///< lanes that worked on a pair, or on a part of a pair, such as a face or triangle
  /// Search steps. Hulls: directions evaluated. Meshes: tree nodes visited and triangles tested exactly; for two
  /// meshes, pairs of tree nodes and pairs of triangles. Kernels without a search: 0.
  std::uint64_t iterations = 0;
  std::uint64_t ended_early = 0;         ///< candidates that an axis remembered from an earlier frame proved separate
  std::uint64_t timed = 0;               ///< candidates that were timed
  std::uint64_t nanoseconds = 0;         ///< wall time in the kernels for the timed candidates, gathering included
  std::uint64_t gather_nanoseconds = 0;  ///< part of nanoseconds: reading bodies and shapes into the kernel's layout
  std::array<std::uint64_t, cost_buckets> cost{};  ///< timed candidates by cost
};

}  // namespace ringfence
