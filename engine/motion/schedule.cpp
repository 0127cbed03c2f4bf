#include "motion/schedule.hpp"

#include <string>

#include "motion/random.hpp"
#include "ringfence/error.hpp"

namespace ringfence::motion {
namespace {

constexpr std::uint32_t max_interval = 1'000'000'000;
// The number of a period that no frame reaches. The random phase of a subject is drawn with it.
constexpr std::uint32_t phase_epoch = 0xffffffffu;

}  // namespace

Schedule::Schedule(Interval interval, std::uint64_t seed, std::uint32_t stream)
    : seed_(seed),
      stream_(stream),
      period_(interval.min + (interval.max - interval.min) / 2),
      jitter_((interval.max - interval.min) / 2) {
  if (interval.min < 1 || interval.max < interval.min || interval.max > max_interval) {
    throw Error("interval " + std::to_string(interval.min) + ":" + std::to_string(interval.max) +
                ": expected A:B frames with 1 <= A <= B <= " + std::to_string(max_interval));
  }
}

// Returns the first frame of a period, plus the phase. Consecutive starts are period - jitter to period + jitter apart.
// That is in [min, max], because jitter <= period - min and jitter <= max - period.
std::uint64_t Schedule::start(std::uint32_t subject, std::uint64_t epoch) const noexcept {
  const auto words = philox({subject, static_cast<std::uint32_t>(epoch), 0, stream_}, seed_);
  return epoch * period_ + uniform_below(jitter_ + 1, words[0]);
}

SchedulePeriod Schedule::at(std::uint32_t subject, std::uint64_t frame) const noexcept {
  // A phase of one to two periods spreads the subjects over time. It makes epoch at least 1, so that --epoch is safe.
  const std::uint64_t phase = period_ + uniform_below(period_, philox({subject, phase_epoch, 0, stream_}, seed_)[0]);
  const std::uint64_t time = frame + phase;
  std::uint64_t epoch = time / period_;
  std::uint64_t end = start(subject, epoch);
  if (time < end) {
    --epoch;
  } else {
    end = start(subject, epoch + 1);
  }
  return {static_cast<std::uint32_t>(epoch), end - phase};
}

}  // namespace ringfence::motion
