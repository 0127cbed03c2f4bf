#pragma once

#include <chrono>
#include <cstdint>

namespace ringfence::tools {

/// A line on standard error that says how far a run is; only on a terminal, at most ten times a second.
class Progress {
 public:
  Progress(bool quiet, std::uint64_t steps);
  ~Progress() { finish(); }
  Progress(const Progress&) = delete;
  Progress& operator=(const Progress&) = delete;

  void step();
  /// Clears the line.
  void finish();

 private:
  bool shown_;
  std::uint64_t steps_;
  std::uint64_t at_ = 0;
  std::chrono::steady_clock::time_point next_;
};

}  // namespace ringfence::tools
