#pragma once

#include <atomic>
#include <chrono>
#include <cstdint>

#include "link/atomics.hpp"

namespace ringfence::link {

/// How the owner of a Doorbell sleeps and is woken: on a futex; or, after prepare(), until a ring or until a watched
/// file descriptor is readable. So one thread can wait for other threads and for sockets.
///
/// May wake up without cause. Threads: only the owner may call `watch` and the sleeps, any thread `wake`. prepare() is
/// called before another thread can ring.
class DescriptorSleeper {
 public:
  DescriptorSleeper() = default;
  ~DescriptorSleeper();
  DescriptorSleeper(const DescriptorSleeper&) = delete;
  DescriptorSleeper& operator=(const DescriptorSleeper&) = delete;

  /// Returns false if the system has no descriptor for the rings.
  [[nodiscard]] bool prepare() noexcept;
  /// Later sleeps also end when `descriptor` is readable; -1: only by rings. The descriptor stays open while it is
  /// watched. After prepare().
  void watch(int descriptor) noexcept { watched_ = descriptor; }

  void sleep(const std::atomic<std::uint32_t>& word, std::uint32_t expected) const noexcept;
  void sleep_until(const std::atomic<std::uint32_t>& word, std::uint32_t expected,
                   std::chrono::steady_clock::time_point deadline) const noexcept;
  void wake(const std::atomic<std::uint32_t>& word) const noexcept;

 private:
  void poll(std::chrono::nanoseconds timeout) const noexcept;

  int rings_ = -1;  ///< eventfd that wake() writes; -1: sleep on a futex
  int watched_ = -1;
};

}  // namespace ringfence::link
