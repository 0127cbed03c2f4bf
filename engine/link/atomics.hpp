#pragma once

#include <atomic>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <cstring>

#include "base/prefetch.hpp"
#include "base/stream_lines.hpp"

namespace ringfence::link {

/// Alignment, in bytes, that keeps two variables written by different threads from false sharing. x86 prefetches cache
/// lines in pairs, so it is two lines.
inline constexpr std::size_t cache_line_pair_bytes = 128;

/// Defects that tests/link inserts into the primitives, one at a time, to check that its model checker
/// detects them.
///
/// Each enumerator breaks one property that the proof of correctness needs. Production code is instantiated with
/// `none`, so every test of a defect is a compile-time false. No memory order in this module is stronger than
/// necessary: the tests fail when any of them is weakened.
enum class Defect : std::uint8_t {
  none,
  publish_unordered,          ///< the store of tail is not a release
  peek_unordered,             ///< the load of tail is not an acquire
  release_unordered,          ///< the exchange of head is not a release
  room_unordered,             ///< the load of head is not an acquire
  wait_unordered,             ///< the read-modify-write of head that requests a ring is not an acquire
  ring_unordered,             ///< the doorbell's exchange in ring() is not a release
  arm_unordered,              ///< the doorbell's exchange before sleeping is not an acquire
  disarm_by_store,            ///< an owner that does not need to sleep clears the state by a plain store, which loses a
                              ///< concurrent ring
  no_recheck,                 ///< the owner does not test the condition again after it has set `asleep`
  flag_set_late,              ///< the owner tests the condition before it sets `asleep`, not after
  capacity_off_by_one,        ///< the writer uses 8 bytes more than the capacity
  early_release,              ///< a message is released when it is returned, not after it was read
  padding_lost,               ///< the writer advances by less than the stride in the header
  stride_not_updated,         ///< publishing skips to the next cache line without an update of the last header's stride
  stride_updated_late,        ///< the last header's stride is updated after the message is published
  stage_copied_late,          ///< the stage is copied into the ring after its messages are published
  stage_overtaken,            ///< a message in place does not wait until the stage before it is copied
  stage_crosses_end,          ///< a stage that crosses the end of the ring is copied in one piece
  length_of_run_not_checked,  ///< a shorter message continues a run
  run_released_early,         ///< a run is released when its first message has been returned
  prefetched_unreleased,      ///< the writer prefetches lines that the reader has not released
  evicted_released,           ///< the reader evicts a line that it has released
  prefetched_unpublished,     ///< the reader prefetches lines that the writer has not published
  overhang_lost,              ///< a message that crosses the end of the ring is not stored contiguously
  waiting_sender_not_rung,    ///< a release does not ring the sender that waits for room
  waiting_flag_not_set,       ///< a sender that finds no room does not request a ring
  no_publish_when_full,       ///< a sender that finds no room does not publish what it has staged
  close_without_ring,         ///< closing does not ring the other end
  deadline_not_set,           ///< a wait with a deadline sleeps without a timeout
  deadline_not_checked,       ///< a wait with a deadline does not check the clock
  timeout_reported_as_ready,  ///< a wait that timed out returns true
  ring_cleared_by_store,      ///< the owner acknowledges a ring by a plain store, which loses a concurrent ring
  wave_unordered,             ///< the store of a wave number is not a release
  wave_peek_unordered,        ///< the load of a wave number is not an acquire
  wave_stored_late,           ///< the waker rings the first members before it stores the wave number
  arrival_unordered,          ///< an arrival does not acquire what earlier ones released
  arrived_unordered,          ///< the load of who has arrived is not an acquire
};

/// How a waiting thread polls its condition before it announces that it sleeps, polls once more, and sleeps.
struct SpinPolicy {
  std::uint32_t pause_polls = 0;  ///< polls with a pause instruction after each
  std::uint32_t yield_polls = 0;  ///< polls with a sched_yield after each; they follow the pause polls
  /// Polls without a pause, before the others: a reply that is on its way arrives after about 150 ns.
  std::uint32_t immediate_polls = 0;
  /// Pause and yield polls test the condition only after a ring: for conditions that are expensive to test.
  bool poll_only_after_ring = false;
  /// Yields in addition to `yield_polls`, each of which must return at once: then no other thread wants the core, which
  /// would be idle if this thread slept, and to wake it would take about 50 us.
  std::uint32_t idle_yields = 0;
};

/// How a ring uses the machine's cache lines, in bytes. Affects speed only.
struct CacheLineTuning {
  std::size_t line = 64;  ///< cache line size: a power of two, at least 16
  /// The end of a message of at least this size is padded to a cache line, which costs less than messages that share
  /// lines.
  std::size_t pad_from = 1024;
  /// Messages of up to this size are put together in the writer's stage, if it has one and they are published together.
  std::size_t stage_up_to = 1024;
  /// Where the policy streams copies: messages from `stream_from` to `stream_up_to` bytes are staged too, also if they
  /// are published alone, and copies of at least `stream_from` bytes are streamed. When at least `stream_from` bytes of
  /// messages up to `stream_up_to` are released, the reader evicts their lines.
  std::size_t stream_from = 512;
  std::size_t stream_up_to = 4096;
  /// Where it does not: after the first message of a run in the stage, and after one of at least `prefetch_from` bytes
  /// in place, the writer prefetches the next `write_prefetch` bytes for writing, as far as the reader has released
  /// them, in steps of at least `write_prefetch_step`. Those lines are still in the reader's cache from the previous
  /// pass over the ring.
  std::size_t prefetch_from = 256;
  std::size_t write_prefetch = 4096;
  std::size_t write_prefetch_step = 512;
  /// When the first message of a run is read, the reader prefetches the published bytes behind the run, up to
  /// `read_prefetch`, in steps of at least `read_prefetch_step`. It does not after a run of at least `no_prefetch_from`
  /// bytes: the hardware prefetcher follows those.
  std::size_t read_prefetch = 2048;
  std::size_t read_prefetch_step = 512;
  std::size_t no_prefetch_from = 2048;
};

/// The machine's atomics, memory and futex: the policy of ring and doorbell in production.
///
/// Ring, doorbell and channel access memory shared by two threads only through their policy, so the model checker in
/// tests/link runs the same code on its own memory model. `sleep` and `wake` work among the threads of one process.
struct ThreadAtomics {
  static constexpr Defect defect = Defect::none;

  template <class T>
  using Atomic = std::atomic<T>;

  static constexpr CacheLineTuning lines{};

  /// Plain access to an 8-byte word of ring memory. Only the ring's atomics order it.
  static void write(std::byte* at, std::uint64_t word) noexcept { std::memcpy(at, &word, sizeof word); }
  static std::uint64_t read(const std::byte* at) noexcept {
    std::uint64_t word;
    std::memcpy(&word, at, sizeof word);
    return word;
  }

  /// Copies into ring memory from memory of the thread's own. Only the ring's atomics order it.
  static void copy(std::byte* to, const std::byte* from, std::size_t bytes) noexcept {
    if (bytes < lines.stream_from || !streams_copies()) {
      std::memcpy(to, from, bytes);
      return;
    }
    base::stream_bytes(to, from, bytes);
    // A release store does not order them.
    base::finish_streams();
  }

  /// Whether copies into a ring are streamed past the caches, to memory, and their reader evicts them when it has read
  /// them: on AMD processors. A line that is in another core's cache must be invalidated there before it is written,
  /// and be sent back to be read. Streaming takes 5 to 6 ns a line wherever the two cores are; through the caches it is
  /// 8 with a common third-level cache and 33 without (EPYC of 2023). Elsewhere, lines are prefetched for writing: on
  /// an Intel Xeon that makes messages of 16 to 1024 bytes a third faster.
  static bool streams_copies() noexcept;
  /// Evicts a line of ring memory that this thread has read and not released yet from the caches.
  static void evict(const std::byte* at) noexcept { base::evict_line(at); }
  /// Prefetches a line of ring memory that this thread writes soon and that no other thread reads or writes.
  static void prefetch_for_write(const std::byte* at) noexcept { base::prefetch_for_write(at); }
  /// Prefetches a line of ring memory that is published.
  static void prefetch_for_read(const std::byte* at) noexcept { base::prefetch_for_read(at); }
  /// Prefetches a line of ring memory that the other thread may publish at this moment.
  static void prefetch_awaited(const std::byte* at) noexcept { base::prefetch_for_read(at); }

  /// Sleeps while `word` equals `expected`. May return early (spurious wake-up).
  static void sleep(const Atomic<std::uint32_t>& word, std::uint32_t expected) noexcept;
  /// Like `sleep`, but returns at `deadline` at the latest.
  static void sleep_until(const Atomic<std::uint32_t>& word, std::uint32_t expected,
                          std::chrono::steady_clock::time_point deadline) noexcept;
  /// Wakes all threads that sleep on `word`.
  static void wake(const Atomic<std::uint32_t>& word) noexcept;
  static bool is_past(std::chrono::steady_clock::time_point deadline) noexcept {
    return std::chrono::steady_clock::now() >= deadline;
  }

  static void pause() noexcept;
  /// Lets other threads run on this core. Returns whether one presumably did.
  static bool yield() noexcept;
  /// Call it after yields, before the thread does anything else: adds the CPU time since the first one that returned
  /// false to telemetry::polled_cpu_ns.
  static void end_yields() noexcept;

  /// A doorbell is constructed or destroyed: one thread more, or less, of this process waits on doorbells.
  static void add_waiting_thread() noexcept;
  static void remove_waiting_thread() noexcept;
  /// The default policy for the next wait of this thread, from the number of threads that wait on doorbells, the number
  /// of cores, and how long the thread's last yields took.
  static SpinPolicy spin_policy() noexcept;
};

/// Like ThreadAtomics, but `sleep` and `wake` work between processes: for rings and doorbells in shared memory.
struct ProcessAtomics : ThreadAtomics {
  static void sleep(const Atomic<std::uint32_t>& word, std::uint32_t expected) noexcept;
  static void sleep_until(const Atomic<std::uint32_t>& word, std::uint32_t expected,
                          std::chrono::steady_clock::time_point deadline) noexcept;
  static void wake(const Atomic<std::uint32_t>& word) noexcept;
};

static_assert(std::atomic<std::uint64_t>::is_always_lock_free && std::atomic<std::uint32_t>::is_always_lock_free);

/// Returns `order`, or relaxed where `defect` is inserted.
template <class Policy>
constexpr std::memory_order order_unless(Defect defect, std::memory_order order) noexcept {
  return Policy::defect == defect ? std::memory_order_relaxed : order;
}

}  // namespace ringfence::link
