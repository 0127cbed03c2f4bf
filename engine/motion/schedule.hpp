#pragma once

#include <cstdint>

namespace ringfence::motion {

/// The range of a random time between two events, in frames: 1 <= min <= max.
struct Interval {
  std::uint32_t min = 1;
  std::uint32_t max = 1;
  constexpr bool operator==(const Interval&) const noexcept = default;
};

/// The time between two events of a subject. A decision made at its start holds until `end`.
struct SchedulePeriod {
  std::uint32_t number = 0;  ///< counts the subject's periods; the random draws of a period depend on it
  std::uint64_t end = 0;     ///< first frame of the next period
};

/// Schedules events that repeat at random times: targets relocate, objects choose another target.
///
/// The period that contains a frame is a pure function of (seed, stream, subject, frame), computed in constant time for
/// any frame. Period e begins at frame e * mean + jitter(e) - phase. Here mean is (min + max) / 2, jitter(e) is uniform
/// in 0 .. (max - min) / 2, and phase is a random offset of the subject. All are integers and rounded down. So every
/// time between two events is in [min, max], with a triangular distribution, and no period depends on the one before.
/// Immutable; any thread may use it.
class Schedule {
 public:
  /// Throws Error unless 1 <= min <= max <= 10^9. `stream` separates schedules with the same seed.
  Schedule(Interval interval, std::uint64_t seed, std::uint32_t stream);

  /// The period of `subject` that contains `frame`.
  SchedulePeriod at(std::uint32_t subject, std::uint64_t frame) const noexcept;

 private:
  std::uint64_t start(std::uint32_t subject, std::uint64_t epoch) const noexcept;

  std::uint64_t seed_;
  std::uint32_t stream_;
  std::uint32_t period_;
  std::uint32_t jitter_;
};

}  // namespace ringfence::motion
