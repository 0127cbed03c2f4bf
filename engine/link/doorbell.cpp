#include "link/doorbell.hpp"

#include <climits>
#include <utility>

#if defined(__x86_64__)
#include <cpuid.h>
#endif
#include <linux/futex.h>
#include <sched.h>
#include <sys/syscall.h>
#include <time.h>
#include <unistd.h>

#include "telemetry/clock.hpp"

namespace ringfence::link {

namespace {

std::atomic<int> waiting_threads{0};

/// A thread that yields stays in the queue of its core until the threads there have used up their slices, also when
/// another core becomes idle. A thread that sleeps is woken on an idle core, which takes about 50 us. So after a yield
/// that took longer than `long_yield`, a thread sleeps without yields in the next `waits_after_long_yield` waits.
constexpr auto long_yield = std::chrono::milliseconds(1);
constexpr std::uint32_t waits_after_long_yield = 64;
thread_local std::uint32_t waits_without_yields = 0;

/// A yield takes 0.3 to 1.1 us if no other thread runs. In one of more than `short_yield` another thread presumably
/// ran. After a shorter one the thread pauses `idle_pauses` times, because another one may run on the same core (SMT).
constexpr auto short_yield = std::chrono::microseconds(3);
constexpr int idle_pauses = 16;
thread_local std::uint64_t idle_since_cpu_ns = 0;  ///< 0: the last yield was not idle

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

#if defined(__x86_64__)
bool has_clflushopt() noexcept {
  unsigned a = 0, b = 0, c = 0, d = 0;
  constexpr unsigned clflushopt = 1u << 23;
  return __get_cpuid_count(7, 0, &a, &b, &c, &d) != 0 && (b & clflushopt) != 0;
}
#endif

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
  static const bool amd = __builtin_cpu_is("amd") != 0 && has_clflushopt();
  return amd;
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

bool ThreadAtomics::yield() noexcept {
  const auto begin = std::chrono::steady_clock::now();
  sched_yield();
  const auto passed = std::chrono::steady_clock::now() - begin;
  if (passed > long_yield) waits_without_yields = waits_after_long_yield;
  if (passed > short_yield) return true;
  if (idle_since_cpu_ns == 0) idle_since_cpu_ns = telemetry::thread_cpu_ns();
  for (int i = 0; i < idle_pauses; ++i) pause();
  return false;
}

void ThreadAtomics::end_yields() noexcept {
  if (idle_since_cpu_ns == 0) return;
  telemetry::polled_cpu_ns += telemetry::thread_cpu_ns() - std::exchange(idle_since_cpu_ns, 0);
}

void ThreadAtomics::add_waiting_thread() noexcept { waiting_threads.fetch_add(1, std::memory_order_relaxed); }

void ThreadAtomics::remove_waiting_thread() noexcept { waiting_threads.fetch_sub(1, std::memory_order_relaxed); }

SpinPolicy ThreadAtomics::spin_policy() noexcept {
  static const int cores = usable_cores();
  const bool oversubscribed = waiting_threads.load(std::memory_order_relaxed) > cores;
  // With a core for each thread, polling costs less than sleeping.
  if (!oversubscribed) return {2000, 3, 100};
  // Otherwise the awaited thread may need this core, so the thread polls only briefly, and tests the condition only
  // after a ring: to test it, a server or user thread polls up to a hundred channels.
  // 150 yields on an idle core take about 0.14 ms with their pauses (Zen 4).
  const bool yields = waits_without_yields == 0;
  if (!yields) --waits_without_yields;
  return {20, yields ? 3u : 0u, 0, true, 150};
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
