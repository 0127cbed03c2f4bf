#pragma once

#include <chrono>
#include <cstdint>
#include <string>

namespace ringfence::tools {

/// A line on standard error that says how far a run is and how long the rest will take; only on a terminal, at most ten
/// times a second.
class Progress {
 public:
  Progress(bool quiet, std::uint64_t steps);
  ~Progress() { finish(); }
  Progress(const Progress&) = delete;
  Progress& operator=(const Progress&) = delete;

  /// What the line says in place of counting frames.
  void name(std::string what) { name_ = std::move(what); }
  void step(std::uint64_t steps = 1);
  /// Clears the line.
  void finish();

 private:
  bool shown_;
  std::uint64_t steps_;
  std::uint64_t at_ = 0;
  std::string name_;
  std::chrono::steady_clock::time_point start_ = std::chrono::steady_clock::now();
  std::chrono::steady_clock::time_point next_;
};

/// How long the rest of a task will take, in words, from what is done of it; empty in its first second.
std::string time_left(double elapsed_s, double share_done);

}  // namespace ringfence::tools
