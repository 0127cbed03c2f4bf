#pragma once

#include <cstdint>
#include <ctime>

namespace ringfence::telemetry {

/// Time of the monotonic clock, in ns. A call takes about 20 ns.
inline std::uint64_t now_ns() noexcept {
  timespec t{};
  clock_gettime(CLOCK_MONOTONIC, &t);
  return static_cast<std::uint64_t>(t.tv_sec) * 1'000'000'000u + static_cast<std::uint64_t>(t.tv_nsec);
}

/// Time of the monotonic clock, in seconds.
inline double now_s() noexcept { return static_cast<double>(now_ns()) * 1e-9; }

/// CPU time of the calling thread, in ns. Makes a system call: for use a few times per role and frame, not in loops.
inline std::uint64_t thread_cpu_ns() noexcept {
  timespec t{};
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &t);
  return static_cast<std::uint64_t>(t.tv_sec) * 1'000'000'000u + static_cast<std::uint64_t>(t.tv_nsec);
}

/// CPU time that the calling thread has spent on polls instead of sleeping, in ns, as far as it is known: see
/// link::SpinPolicy::idle_yields.
inline constinit thread_local std::uint64_t polled_cpu_ns = 0;

/// CPU time of the calling thread without such polls, in ns. Costs as much as thread_cpu_ns().
inline std::uint64_t working_cpu_ns() noexcept { return thread_cpu_ns() - polled_cpu_ns; }

/// The part of a measured interval that is the cost of `now_ns` itself, in ns. It is the shortest of 64 empty
/// intervals, which the first call measures. May be called from any thread.
inline std::uint64_t clock_cost_ns() noexcept {
  static const std::uint64_t cost = [] {
    std::uint64_t smallest = ~std::uint64_t{0};
    for (int i = 0; i < 64; ++i) {
      const std::uint64_t begin = now_ns(), end = now_ns();
      smallest = end - begin < smallest ? end - begin : smallest;
    }
    return smallest;
  }();
  return cost;
}

inline double to_ms(std::uint64_t ns) noexcept { return static_cast<double>(ns) * 1e-6; }

}  // namespace ringfence::telemetry
