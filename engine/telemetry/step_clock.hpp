#pragma once

#include <array>
#include <atomic>
#include <cstddef>
#include <cstdint>
#include <utility>

#include "telemetry/clock.hpp"

namespace ringfence::telemetry {

/// CPU time of a thread that runs many user nodes, by step of the frame.
///
/// Each user node calls enter() with the step that it begins. The clock is read only when the step changes, so the cost
/// is a few system calls a frame, not a few for each user node. Time between two calls counts for the earlier step,
/// except for polls instead of sleeping (working_cpu_ns).
///
/// Threads: enter() by the measured thread; take() by any other thread, between frames.
class StepClock {
 public:
  /// The steps of a user node; `end` is everything except the first two: receiving, reporting and waiting.
  enum Step : std::uint8_t { move, read_publications, end };

  /// Begins a step.
  void enter(Step step) noexcept {
    if (step != step_) {
      const std::uint64_t now = working_cpu_ns();
      spent_ns_[step_].fetch_add(now - std::exchange(entered_ns_, now), std::memory_order_relaxed);
      step_ = step;
    }
  }
  /// Returns the ns spent in `step` since the last call and resets them. Time of an unfinished step is not included.
  std::uint64_t take(Step step) noexcept { return spent_ns_[step].exchange(0, std::memory_order_relaxed); }

 private:
  Step step_ = end;
  std::uint64_t entered_ns_ = 0;
  // Atomic, because the thread of a user node that missed its deadline may still call enter() after the frame.
  std::array<std::atomic<std::uint64_t>, 3> spent_ns_{};
};

}  // namespace ringfence::telemetry
