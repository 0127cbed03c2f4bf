#pragma once

#include <chrono>
#include <cstdint>

#include "job.hpp"
#include "node_processes.hpp"
#include "progress.hpp"
#include "ringfence/world.hpp"

namespace ringfence::tools {

/// Says while a run goes on how it stands: on a terminal the line of Progress, which names the nodes where they are
/// processes, and once a second a file for whoever watches (--status). Outside the frames that are timed.
class StatusLine {
 public:
  /// `crew` null: nodes are threads. All outlive it.
  StatusLine(const Job& job, const World& world, const NodeProcesses* node_processes, Progress& progress);

  /// A frame is complete.
  void step();
  /// Says it once more, and clears the line.
  void finish();

 private:
  void update(bool last);
  void write(bool last) const;

  const Job& job_;
  const World& world_;
  const NodeProcesses* node_processes_;
  Progress& progress_;
  std::chrono::steady_clock::time_point next_;
  std::uint64_t last_frames_ = 0;
  std::uint64_t last_bytes_ = 0;
  std::chrono::steady_clock::time_point last_update_;
};

}  // namespace ringfence::tools
