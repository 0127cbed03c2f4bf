#pragma once

#include <cstdint>

namespace ringfence::motion {

/// A random time between two events, in frames: `min` to `max`, 1 <= min <= max.
struct Interval {
  std::uint32_t min = 1;
  std::uint32_t max = 1;
  constexpr bool operator==(const Interval&) const noexcept = default;
};

/// One turn of a subject: what it decided at its start holds until `end`.
struct SchedulePeriod {
  std::uint32_t number = 0;  ///< counts the turns; keys what is drawn for this one
  std::uint64_t end = 0;     ///< the first frame of the next turn
};

/// When things happen again at random times: targets relocate, objects pick another target.
///
/// The turn that holds a frame is a pure function of (seed, stream, subject, frame), found in constant time at any
/// frame: turn e begins at e * period + jitter(e) - phase, with period = (min + max) / 2 and the jitter uniform in
/// 0 .. (max - min) / 2, so that every time between two events lies in [min, max] (their distribution is a triangle
/// about the middle) and no turn depends on the one before. Immutable; any thread may read it.
class Schedule {
 public:
  /// Throws Error unless 1 <= min <= max <= 10^9. `stream` tells schedules of one seed apart.
  Schedule(Interval interval, std::uint64_t seed, std::uint32_t stream);

  SchedulePeriod at(std::uint32_t subject, std::uint64_t frame) const noexcept;

 private:
  std::uint64_t start(std::uint32_t subject, std::uint64_t epoch) const noexcept;

  std::uint64_t seed_;
  std::uint32_t stream_;
  std::uint32_t period_;
  std::uint32_t jitter_;
};

}  // namespace ringfence::motion
