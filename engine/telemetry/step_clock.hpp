#pragma once

#include <array>
#include <atomic>
#include <cstddef>
#include <cstdint>
#include <utility>

#include "telemetry/clock.hpp"

namespace ringfence::telemetry {

/// What the CPU time of a thread that steps many user nodes went to, by the step of the frame that they are in.
///
/// Each says which step it enters; the clock is looked at where that is another than the thread is in, so that it costs
/// a few system calls a frame, not a few a user node. What passes between two entries, looking for messages included,
/// belongs to the former.
///
/// Threads: enter() by the thread that it counts; take() by any other, between frames.
class StepClock {
 public:
  enum Step : std::uint8_t { move, read_publications, end };

  void enter(Step step) noexcept {
    if (step != step_) {
      const std::uint64_t now = thread_cpu_ns();
      spent_[step_].fetch_add(now - std::exchange(mark_, now), std::memory_order_relaxed);
      step_ = step;
    }
  }
  /// Nanoseconds in that step, if it was left since the last call.
  std::uint64_t take(Step step) noexcept { return spent_[step].exchange(0, std::memory_order_relaxed); }

 private:
  Step step_ = end;
  std::uint64_t mark_ = 0;
  // Of a user node that is late nobody knows whether it still moves when the frame is over.
  std::array<std::atomic<std::uint64_t>, 3> spent_{};
};

}  // namespace ringfence::telemetry
