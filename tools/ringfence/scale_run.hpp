#pragma once

#include <array>
#include <cstdint>
#include <functional>
#include <optional>

#include "job.hpp"
#include "ringfence/frame_report.hpp"

namespace ringfence::tools {

/// Mean traffic of one kind per frame.
struct MeanTraffic {
  double messages = 0, records = 0, bytes = 0;
};

/// Mean counts per frame, the input of cluster models.
struct FrameCounts {
  double objects = 0, users = 0, nodes = 0;
  Placement placement = Placement::server;                     ///< where the broad phase ran; never `automatic`
  double user_hosted = 0, server_hosted = 0, node_hosted = 0;  ///< movable objects by the kind of their host
  double moved = 0, tested = 0, contacts = 0, handed_over = 0;
  double busiest_tested = 0;       ///< pairs of the node that tested most in each frame
  double publication_notices = 0;  ///< control messages that announce readable shared memory
  double node_notices = 0;         ///< records of M4 between CD nodes: those that the same world with one node has not
  std::array<MeanTraffic, traffic_count> traffic{};

  MeanTraffic& operator[](Traffic kind) { return traffic[static_cast<std::size_t>(kind)]; }
  const MeanTraffic& operator[](Traffic kind) const { return traffic[static_cast<std::size_t>(kind)]; }
};

/// Results of one run. Times are in milliseconds, medians over its frames unless stated otherwise.
struct ScaleSample {
  double wall_ms = 0;
  double server_ms = 0;       ///< CPU time of the server's thread; with nodes = 0 of the only thread
  double node_ms = 0;         ///< CPU time of the busiest CD node of each frame; 0 with nodes = 0
  double users_ms = 0;        ///< CPU time of the busiest user thread of each frame; 0 with nodes = 0
  double path_ms = 0;         ///< PathReport::critical_ms: the critical path without wake-ups
  double undisturbed_ms = 0;  ///< PathReport::critical_ms of PathSamples::undisturbed()
  double imbalance = 1;       ///< Figures::cpu_imbalance; 1 if the run is too short for it
  // Means over the frames, scaled by the share of their busy time in which nodes had a core.
  double narrow_phase_ms = 0, move_ms = 0;  ///< sums over all nodes
  double broad_phase_ms = 0;                ///< on the server
  std::uint64_t digest = 0;
  bool counts_match = true;  ///< each candidate was tested and accepted exactly once
  FrameCounts counts;
};

/// Runs all frames of `job`, warm-up included, and calls `step` after each. If `step` returns false the run ends there,
/// and there is no result. Throws Error and IncompleteError.
std::optional<ScaleSample> run_sample(const Job& job, const std::function<bool()>& step);

}  // namespace ringfence::tools
