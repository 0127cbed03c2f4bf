#pragma once

#include <cstdint>
#include <ctime>

namespace ringfence::telemetry {

/// Nanoseconds of the monotonic clock. About 20 ns a call.
inline std::uint64_t now_ns() noexcept {
  timespec t{};
  clock_gettime(CLOCK_MONOTONIC, &t);
  return static_cast<std::uint64_t>(t.tv_sec) * 1'000'000'000u + static_cast<std::uint64_t>(t.tv_nsec);
}

/// CPU nanoseconds of the calling thread. A system call: once a role and frame, not in loops.
inline std::uint64_t thread_cpu_ns() noexcept {
  timespec t{};
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &t);
  return static_cast<std::uint64_t>(t.tv_sec) * 1'000'000'000u + static_cast<std::uint64_t>(t.tv_nsec);
}

/// What one call of `now_ns` adds to the time between two of them: the least of some, measured at the first call.
inline std::uint64_t clock_cost_ns() noexcept {
  static const std::uint64_t cost = [] {
    std::uint64_t least = ~std::uint64_t{0};
    for (int i = 0; i < 64; ++i) {
      const std::uint64_t begin = now_ns(), end = now_ns();
      least = end - begin < least ? end - begin : least;
    }
    return least;
  }();
  return cost;
}

inline double to_ms(std::uint64_t ns) noexcept { return static_cast<double>(ns) * 1e-6; }

}  // namespace ringfence::telemetry
