#pragma once

#include <chrono>
#include <cstdint>
#include <memory>

#include "gateway/metrics_endpoint.hpp"
#include "job.hpp"
#include "node_processes.hpp"
#include "progress.hpp"
#include "ringfence/world.hpp"

namespace ringfence::tools {

/// Reports the state of a run while it runs: the progress line on a terminal, with node statistics if CD nodes are
/// processes, and once a second the file of --status and the values of --metrics. Its work is not part of the measured
/// frame times.
class StatusLine {
 public:
  /// `node_processes` is null if CD nodes are threads. All arguments must outlive the status line.
  StatusLine(const Job& job, const World& world, const NodeProcesses* node_processes, Progress& progress);

  /// To be called after each frame.
  void step();
  /// Writes the final status and clears the line. `ended_by` is the signal that ended the run, or null.
  void finish(const char* ended_by);

 private:
  void update(bool last);
  void write(bool last) const;

  const char* ended_by_ = nullptr;

  const Job& job_;
  const World& world_;
  const NodeProcesses* node_processes_;
  Progress& progress_;
  std::unique_ptr<gateway::MetricsEndpoint> metrics_;  ///< null without --metrics
  std::chrono::steady_clock::time_point next_;
  std::uint64_t last_frames_ = 0;
  std::uint64_t last_bytes_ = 0;
  std::chrono::steady_clock::time_point last_update_;
};

}  // namespace ringfence::tools
