#pragma once

#include <cstdint>

namespace ringfence::tools {

/// Starts frames at a steady rate. A frame that takes longer than its share delays the next; time that was lost so is
/// not made up.
class FrameClock {
 public:
  /// `rate`: frames per second, above 0.
  explicit FrameClock(double rate);
  /// Sleeps until the next frame is due, or until a signal arrives.
  void wait();
  /// Number of frames that were longer than their share.
  std::uint64_t late() const noexcept { return late_; }

 private:
  std::uint64_t period_ns_;
  std::uint64_t next_ns_ = 0;  ///< of the monotonic clock; 0: none yet
  std::uint64_t late_ = 0;
};

}  // namespace ringfence::tools
