#pragma once

#include <array>
#include <cstdint>
#include <functional>

#include "job.hpp"
#include "ringfence/frame_report.hpp"

namespace ringfence::tools {

/// Messages of one kind in a mean frame.
struct MeanTraffic {
  double messages = 0, records = 0, bytes = 0;
};

/// What a mean frame did, as counted: what cluster models are computed from.
struct FrameCounts {
  double objects = 0, users = 0, nodes = 0;
  Placement placement = Placement::server;                     ///< where the broad phase ran, never `automatic`
  double user_hosted = 0, server_hosted = 0, node_hosted = 0;  ///< objects that move, by who hosts them
  double moved = 0, tested = 0, contacts = 0, handed_over = 0;
  double busiest_tested = 0;       ///< pairs of the node that tested most, mean over the frames
  double publication_notices = 0;  ///< control messages that say that shared memory can be read
  std::array<MeanTraffic, traffic_count> traffic{};

  MeanTraffic& operator[](Traffic kind) { return traffic[static_cast<std::size_t>(kind)]; }
  const MeanTraffic& operator[](Traffic kind) const { return traffic[static_cast<std::size_t>(kind)]; }
};

/// One run. Times are medians over its frames, milliseconds.
struct ScaleSample {
  double wall_ms = 0;
  double server_ms = 0;  ///< CPU time of the server's thread; with nodes = 0 of the only thread
  double node_ms = 0;    ///< CPU time of the CD node that used most in the frame; 0 with nodes = 0
  double users_ms = 0;   ///< CPU time of the user thread that used most; 0 with nodes = 0
  double path_ms = 0;    ///< PathReport::critical_ms: the critical path without wake-ups
  double imbalance = 1;  ///< Figures::cpu_imbalance; 1 where the run is too short for it
  /// Means over the frames, less the share of time in which busy nodes did not have a core.
  double narrow_phase_ms = 0, move_ms = 0;  ///< of all nodes together
  double broad_phase_ms = 0;                ///< of the server
  std::uint64_t digest = 0;
  bool counts_match = true;  ///< every candidate was tested and accepted exactly once
  FrameCounts counts;
};

/// Runs the job's frames, warm-up first, and calls `step` after each. Throws Error, IncompleteError.
ScaleSample run_sample(const Job& job, const std::function<void()>& step);

/// The value in the middle; 0 of none.
double median(std::vector<double> values);

}  // namespace ringfence::tools
