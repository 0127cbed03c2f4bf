#include "link/doorbell.hpp"

#include <climits>

#include <linux/futex.h>
#include <sched.h>
#include <sys/syscall.h>
#include <time.h>
#include <unistd.h>

namespace ringfence::link {

namespace {

std::atomic<int> waiting_threads{0};

int usable_cores() noexcept {
  cpu_set_t set;
  // The mask of the process's first thread, not of the calling thread, which may be pinned already.
  if (sched_getaffinity(getpid(), sizeof set, &set) != 0) return 1;
  return CPU_COUNT(&set);
}

void futex(const std::atomic<std::uint32_t>& word, int operation, std::uint32_t value,
           const timespec* deadline) noexcept {
  syscall(SYS_futex, reinterpret_cast<const std::uint32_t*>(&word), operation, value, deadline, nullptr,
          FUTEX_BITSET_MATCH_ANY);
}

timespec absolute(std::chrono::steady_clock::time_point time) noexcept {
  const auto since = time.time_since_epoch();
  const auto seconds = std::chrono::duration_cast<std::chrono::seconds>(since);
  return {static_cast<time_t>(seconds.count()),
          static_cast<long>(std::chrono::duration_cast<std::chrono::nanoseconds>(since - seconds).count())};
}

}  // namespace

void ThreadAtomics::sleep(const Atomic<std::uint32_t>& word, std::uint32_t expected) noexcept {
  futex(word, FUTEX_WAIT_BITSET | FUTEX_PRIVATE_FLAG, expected, nullptr);
}

void ThreadAtomics::sleep_until(const Atomic<std::uint32_t>& word, std::uint32_t expected,
                                std::chrono::steady_clock::time_point deadline) noexcept {
  // FUTEX_WAIT_BITSET takes an absolute time of CLOCK_MONOTONIC, which is what steady_clock counts.
  const timespec until = absolute(deadline);
  futex(word, FUTEX_WAIT_BITSET | FUTEX_PRIVATE_FLAG, expected, &until);
}

void ThreadAtomics::wake(const Atomic<std::uint32_t>& word) noexcept {
  futex(word, FUTEX_WAKE_BITSET | FUTEX_PRIVATE_FLAG, INT_MAX, nullptr);
}

bool ThreadAtomics::streams_copies() noexcept {
#if defined(__x86_64__)
  return __builtin_cpu_is("amd") != 0;
#else
  return false;
#endif
}

void ThreadAtomics::pause() noexcept {
#if defined(__x86_64__)
  __builtin_ia32_pause();
#elif defined(__aarch64__)
  asm volatile("yield");
#endif
}

void ThreadAtomics::yield() noexcept { sched_yield(); }

void ThreadAtomics::add_waiting_thread() noexcept { waiting_threads.fetch_add(1, std::memory_order_relaxed); }

void ThreadAtomics::remove_waiting_thread() noexcept { waiting_threads.fetch_sub(1, std::memory_order_relaxed); }

SpinPolicy ThreadAtomics::spin_policy() noexcept {
  static const int cores = usable_cores();
  // If there are more threads than cores, the awaited thread may need this core, so the thread polls only briefly.
  // Otherwise polling costs less than sleeping.
  const bool oversubscribed = waiting_threads.load(std::memory_order_relaxed) > cores;
  // If oversubscribed, the condition is tested only after a ring: to test it, a server or user thread polls up to a
  // hundred channels, on a core that the awaited thread needs.
  return oversubscribed ? SpinPolicy{20, 3, 0, true} : SpinPolicy{2000, 3, 100};
}

void ProcessAtomics::sleep(const Atomic<std::uint32_t>& word, std::uint32_t expected) noexcept {
  futex(word, FUTEX_WAIT_BITSET, expected, nullptr);
}

void ProcessAtomics::sleep_until(const Atomic<std::uint32_t>& word, std::uint32_t expected,
                                 std::chrono::steady_clock::time_point deadline) noexcept {
  const timespec until = absolute(deadline);
  futex(word, FUTEX_WAIT_BITSET, expected, &until);
}

void ProcessAtomics::wake(const Atomic<std::uint32_t>& word) noexcept {
  futex(word, FUTEX_WAKE_BITSET, INT_MAX, nullptr);
}

}  // namespace ringfence::link
