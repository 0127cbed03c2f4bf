#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <string>
#include <utility>
#include <vector>

#include "ringfence/ids.hpp"
#include "ringfence/profile.hpp"
#include "ringfence/query.hpp"
#include "ringfence/status.hpp"

namespace ringfence {

/// The stages of a frame as the server measures them. Their times add up to the time of the frame.
enum class Stage : std::uint8_t {
  move,          ///< from the cut until all hosts have reported their states, without `ingest`
  ingest,        ///< the server reads the reported states
  broad_phase,   ///< the server sweeps and sends pairs; 0 with Placement::region, whose sweeps are in `narrow_phase`
  dispatch,      ///< the server lists and sends the objects that moved
  narrow_phase,  ///< the server waits for the nodes' results and reads them
  collect,       ///< the server merges contacts and computes phases
  notify         ///< the server publishes states, notifies the hosts, and waits until all roles have finished
};
inline constexpr std::size_t stage_count = 7;
/// Name of a stage in reports: that of the enumerator.
constexpr const char* name_of(Stage stage) noexcept {
  constexpr const char* names[] = {"move", "ingest", "broad_phase", "dispatch", "narrow_phase", "collect", "notify"};
  return names[static_cast<std::size_t>(stage)];
}

/// Work of one CD node in one frame. Times in milliseconds.
struct NodeReport {
  NodeId id;           ///< of the node; see FrameReport::nodes
  double busy_ms = 0;  ///< wall time in which the role made progress
  /// CPU time of the node's thread, without what it spends while it waits for the server, unless the node is in another
  /// process; the same as busy_ms if the node has no own thread.
  double cpu_ms = 0;
  double wait_ms = 0;                 ///< FrameReport::frame_ms minus busy_ms
  double move_ms = 0;                 ///< wall time of moving hosted objects
  double broad_phase_ms = 0;          ///< wall time; 0 with Placement::server
  double narrow_phase_ms = 0;         ///< wall time
  std::uint64_t candidates = 0;       ///< pairs that the node owns
  std::uint64_t tested = 0;           ///< pairs that the node tested
  std::uint64_t carried = 0;          ///< pairs whose result the node carried over from the frame before
  std::uint64_t contacts = 0;         ///< pairs in contact, also those that are not in the list
  std::uint64_t failed_supports = 0;  ///< pairs without a contact because a support function failed
  std::uint64_t hosted = 0;           ///< objects that the node hosts after the frame
  std::uint64_t handed_over = 0;      ///< objects that the node handed over to others
  double query_ms = 0;                ///< wall time of answering queries (World::attach)
  std::uint64_t query_boxes = 0;      ///< of QueryWork, for these queries
  std::uint64_t query_tests = 0;      ///< the same
  // CPU time of this node in the sums of which PathReport has the largest.
  double moved_ms = 0;   ///< see PathReport::nodes_moved_ms
  double tested_ms = 0;  ///< see PathReport::nodes_tested_ms
  double ended_ms = 0;   ///< see PathReport::nodes_ended_ms
};

/// Kinds of traffic. m1 to m5 are the messages of the paper (see docs/protocol.md). `state` is the states that CD nodes
/// report, and those that the server and the CD nodes publish for the user nodes. `control` is everything else.
enum class Traffic : std::uint8_t { m1, m2, m3, m4, m5, state, control };
inline constexpr std::size_t traffic_count = 7;
/// Name of a kind of traffic in reports: "m1" to "m5", "state", "control".
constexpr const char* name_of(Traffic traffic) noexcept {
  constexpr const char* names[] = {"m1", "m2", "m3", "m4", "m5", "state", "control"};
  return names[static_cast<std::size_t>(traffic)];
}
/// Traffic of one kind in one frame. What roles read in shared memory instead of messages counts like these messages.
struct TrafficReport {
  std::uint64_t messages = 0;
  std::uint64_t records = 0;
  std::uint64_t bytes = 0;
};

/// An object for which the motion model threw, in `move` or `start`, and what it threw.
struct ModelFailure {
  ObjectId object;
  /// std::exception::what(), at most max_model_failure_text bytes; another text if it threw anything else.
  std::string text;
};
inline constexpr std::size_t max_model_failures = 16;  ///< in one report
inline constexpr std::size_t max_model_failure_text = 200;

/// Results and cost of one frame. Times in milliseconds; wall time unless the name contains `cpu`.
struct FrameReport {
  std::uint64_t frame = 0;                     ///< number of the frame, from 0
  double frame_ms = 0;                         ///< from the cut until all roles have finished
  std::array<double, stage_count> stage_ms{};  ///< by Stage
  /// Pairs that the layers allow and whose bounds overlap or touch, as assigned to nodes.
  std::uint64_t candidates = 0;
  /// Pairs that nodes tested, as they report it. With `carried` they are the candidates, except after a bug or a loss.
  std::uint64_t tested = 0;
  /// Pairs of two objects that rest, whose result nodes carried over from the frame before without a test.
  std::uint64_t carried = 0;
  /// Pairs whose result (contact or none) the server accepted; differs from candidates only after a bug or a loss.
  std::uint64_t accepted = 0;
  std::uint64_t contacts = 0;  ///< contacts that begin or persist
  /// Contacts that were found and are not in the list, because of WorldConfig::deepest_contacts.
  std::uint64_t unlisted = 0;
  /// Of `tested`: pairs without a contact because a support function threw or returned an invalid point; see
  /// SupportFunction. The log has the reason.
  std::uint64_t failed_supports = 0;
  std::uint64_t began = 0, ended = 0;    ///< contacts with phase begin, and with phase end
  std::uint64_t objects = 0, moved = 0;  ///< live objects, and objects that moved, appeared or ended
  std::uint64_t handed_over = 0;         ///< objects whose host changed
  /// Positions of hosted objects that CD nodes gave other CD nodes, counted for each receiver.
  std::uint64_t ghost_updates = 0;
  /// Epoch of the region map for the next frame; increases when regions are balanced or the number of nodes changes.
  std::uint32_t map_epoch = 1;
  std::array<std::uint64_t, status_count> refused{};   ///< refused calls, messages and records, by Status
  std::array<TrafficReport, traffic_count> traffic{};  ///< by Traffic
  /// How many of Capacities::objects, pairs and contacts the frame exceeded, 0 to 3.
  std::uint64_t grown = 0;
  // Without what a thread spends on polls while it waits and no other thread wants its core.
  double server_cpu_ms = 0;        ///< CPU time of the thread that steps the server
  double users_cpu_ms = 0;         ///< CPU time of all user threads together; 0 with nodes = 0
  double slowest_user_cpu_ms = 0;  ///< CPU time of the user thread that used most; 0 with nodes = 0
  PathReport path;
  /// Ids of the CD nodes lost in this frame. Other nodes did their work.
  std::vector<NodeId> lost;
  /// Why Status::model_failed was counted: of the first max_model_failures objects in order of number.
  std::vector<ModelFailure> model_failures;
  std::vector<UserId> late;  ///< user nodes that missed a deadline; they are disconnected at the next cut
  /// The CD nodes of this frame. A node keeps its id and its place in the order as long as it exists; an id is never
  /// used again. The first nodes have the ids 0, 1 and so on, in order; a later node may stand where a node was that is
  /// gone. If a fallback node did the work of the last node, it stands in its place.
  std::vector<NodeReport> nodes;
  QueryWork queries;  ///< what the batches of World::attach cost, at the nodes and on the calling thread
  std::uint64_t recomputed_batches = 0;  ///< batches that the calling thread answered, because a node was lost
  std::vector<KindReport> kinds;         ///< pairs of kinds that had candidates
  /// Empty unless WorldConfig::timeline is set. Contains no spans of lost nodes and remote nodes.
  std::vector<TimelineSpan> timeline;

  static constexpr std::size_t counter_count = 6;
  using Counter = std::pair<const char*, std::uint64_t FrameReport::*>;
  /// Fields whose sums over the frames of a run the program reports, with their JSON keys.
  static constexpr std::array<Counter, counter_count> counters() noexcept {
    return {{{"failed_supports", &FrameReport::failed_supports},
             {"moved", &FrameReport::moved},
             {"handed_over", &FrameReport::handed_over},
             {"ghost_updates", &FrameReport::ghost_updates},
             {"grown", &FrameReport::grown},
             {"unlisted", &FrameReport::unlisted}}};
  }
};

}  // namespace ringfence
