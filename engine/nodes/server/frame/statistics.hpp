#pragma once

#include <cstddef>
#include <cstdint>

#include "messages/header.hpp"
#include "messages/records.hpp"
#include "nodes/server/server_state.hpp"
#include "ringfence/frame_report.hpp"

namespace ringfence::nodes {

/// Fills the report of a frame, ServerState::report(): the time of each stage, the costs of the server's steps and of
/// the nodes, and the traffic. Other parts count what only they know (refusals, contacts, objects) in the report
/// itself.
///
/// Threads: belongs to the server role. Allocates only for new nodes and new pairs of kinds.
class Statistics {
 public:
  explicit Statistics(ServerState& state) noexcept : state_(state) {}

  /// At the cut: starts the report of ServerState::frame and its clocks.
  void begin();
  /// When all nodes of the frame are known: adds an entry for each, by ascending slot.
  void list_nodes();
  /// After a loss: clears what the nodes reported, because the frame is detected again.
  void forget_results();
  /// At the end, after all charges.
  void finish(std::uint64_t moved);

  /// Charges the time since the last charge to a stage, except the part that ingest took; until `now`, telemetry time.
  void charge(Stage stage, std::uint64_t now) noexcept;
  void charge(Stage stage) noexcept;
  /// Charges this much time since the last charge to a stage.
  void charge_part(Stage stage, std::uint64_t ns) noexcept { charge(stage, mark_ns_ + ns); }
  /// Charges the CPU time since the last call to a step of the critical path.
  void charge_cpu(double PathReport::*step) noexcept;
  /// Adds to the time that ingest took since the last charge().
  void add_ingest(std::uint64_t ns) noexcept { ingest_ns_ += ns; }
  /// Time until which stages have been charged.
  std::uint64_t mark_ns() const noexcept { return mark_ns_; }

  /// Notes that a step has been done for a node, if it is not noted yet. Returns true.
  static bool note_reached(PeerSession::Reached& reached) noexcept;
  /// After a step in which nodes were served one after another, from `begin_ns` on: estimates its cost, `step_ms` for
  /// all nodes, up to the moment when each was reached, or all of it if that was not noted. If they were woken when all
  /// were served, each was reached after the step without its rings, and the rings in turn from the server's to its
  /// own.
  void charge_reached(double step_ms, std::uint64_t begin_ns, PeerSession::Reached PeerSession::*reached) noexcept;

  /// Counts a received message.
  void count(const messages::Header& header) noexcept;
  /// Counts records that are read in shared memory, like the message that they replace.
  void count_shared(Traffic kind, std::size_t records, std::size_t bytes_each) noexcept;
  /// Counts what a node of this process reports without a message, like the message that it replaces.
  void count_report(messages::MessageType type, std::size_t records, std::size_t bytes_each) noexcept;
  /// Adds what a node reports when it has tested its pairs.
  void add(const PeerSession& node, const messages::NarrowDoneRecord& done) noexcept;
  /// Adds what a CD node reports at its end of the frame.
  void add(const PeerSession& session, const messages::NodeFrameStats& stats) noexcept;
  /// Adds what the thread of user nodes reports at its end of the frame.
  void add_users(const messages::NodeFrameStats& stats) noexcept;
  /// Adds a node's tests of a pair of kinds of shapes.
  void add(const messages::KindRecord& record);

 private:
  void add_refusals(const messages::NodeFrameStats& stats) noexcept;
  void charge_woken(double step_ms, PeerSession::Reached PeerSession::*reached) noexcept;
  void charge_path(const PeerSession& node, const messages::NodeFrameStats& stats) noexcept;

  ServerState& state_;
  std::uint64_t mark_ns_ = 0;    ///< time until which stages have been charged
  std::uint64_t ingest_ns_ = 0;  ///< ingest time since then
  std::uint64_t cpu_begin_ns_ = 0;
  std::uint64_t cpu_mark_ns_ = 0;  ///< CPU time until which the path has been charged
};

}  // namespace ringfence::nodes
