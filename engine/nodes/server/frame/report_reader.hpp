#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "base/flat_list.hpp"
#include "base/numbers.hpp"
#include "nodes/exchange/frame_control.hpp"
#include "nodes/server/frame/node_results.hpp"
#include "nodes/server/frame/statistics.hpp"
#include "nodes/server/server_state.hpp"

namespace ringfence::nodes {

/// Reads what the CD nodes of this process report (StepReport), in each call only what is new: a word for each 64 nodes
/// says which of them have completed a step. Where no node may be lost, these words are all that is read of the steps
/// that end nothing but a run of messages (`moved`, `published`).
///
/// Where a node may be lost, a bit is a hint, and StepReport::reached says what the node has completed.
///
/// First come the reports, then the messages that were sent before them: so look() is called before the rings are read,
/// and accept() after. What a node reports counts like the messages that it replaces.
///
/// Threads: belongs to the server role. Allocates only for more nodes than before.
class ReportReader {
 public:
  ReportReader(ServerState& state, NodeResults& results, Statistics& statistics) noexcept
      : state_(state), results_(results), statistics_(statistics) {}

  /// At the cut: nothing has been reported.
  void begin() noexcept;
  /// Looks for reports that were not accepted yet.
  void look();
  /// Takes those of the last look() that can be taken now, and sets PeerSession::received. Returns whether any was new.
  bool accept();
  /// When all nodes have tested: adds their tests by kinds of shapes to the report of the frame. These are most of what
  /// the server reads of a node, so they are read while the nodes end the frame.
  void count_kinds();
  /// Whether all nodes of the frame have completed a step. Precondition: none is lost.
  bool all(ReportedStep step) const noexcept { return missing_[index_of(step)] == 0; }

 private:
  struct Seen {
    NodeNumber slot;
    ReportedStep step;
    FrameMark<ReportedStep> reached;  ///< what the node had completed at the last look(), where a node may be lost
  };

  static std::size_t index_of(ReportedStep step) noexcept { return static_cast<std::size_t>(step) - 1; }
  /// Whether a bit of a node says all of this step: it is that of a node of this frame, and has no content.
  bool is_counted(ReportedStep step) const noexcept {
    return !state_.setup.nodes_may_be_lost && (step == ReportedStep::moved || step == ReportedStep::published);
  }
  void list();
  void list(ReportedStep step);
  bool accept_counted(ReportedStep step);
  void count_empty(messages::MessageType type, std::size_t messages) noexcept;
  std::size_t groups() const noexcept { return (state_.nodes.size() + 63) / 64; }
  void load_marks();
  void prefetch_report(const Seen& seen) const noexcept;
  bool has_reached(const Seen& seen) const noexcept {
    return !state_.setup.nodes_may_be_lost || (seen.reached.is_of(state_.frame) && seen.reached.step() >= seen.step);
  }
  bool may_accept(const Seen& seen) const noexcept;
  void accept(PeerSession& node, ReportedStep step);
  void note(const Seen& seen) noexcept;

  static constexpr std::size_t ahead = 6;

  ServerState& state_;
  NodeResults& results_;
  Statistics& statistics_;
  std::array<FrameControl::Members, reported_steps> seen_{};  ///< accepted in this frame
  std::size_t nodes_ = 0;                                     ///< that take part in the frame
  std::array<std::size_t, reported_steps> missing_{};         ///< by step: number of nodes of which none is accepted
  std::array<FrameControl::Members, 2> arrived_{};            ///< at the last look(), of the steps that are counted
  base::FlatList<Seen> reports_;                              ///< of the last look(), of the others
  std::vector<std::span<const messages::KindRecord>> kinds_;  ///< of the nodes, in this frame
};

/// What PeerSession::Received says of a step.
bool& has_completed(PeerSession::Received& received, ReportedStep step) noexcept;

}  // namespace ringfence::nodes
