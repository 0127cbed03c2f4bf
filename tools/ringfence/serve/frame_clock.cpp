#include "serve/frame_clock.hpp"

#include <ctime>

#include "telemetry/clock.hpp"

namespace ringfence::tools {

FrameClock::FrameClock(double rate) : period_ns_(static_cast<std::uint64_t>(1e9 / rate)) {}

void FrameClock::wait() {
  const std::uint64_t now = telemetry::now_ns();
  if (next_ns_ == 0) next_ns_ = now;
  next_ns_ += period_ns_;
  if (next_ns_ <= now) {
    ++late_;
    next_ns_ = now;
    return;
  }
  const timespec due{static_cast<time_t>(next_ns_ / 1'000'000'000u), static_cast<long>(next_ns_ % 1'000'000'000u)};
  clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &due, nullptr);
}

}  // namespace ringfence::tools
