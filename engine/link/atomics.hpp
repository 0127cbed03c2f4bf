#pragma once

#include <atomic>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <cstring>

#include "base/prefetch.hpp"

namespace ringfence::link {

/// What two threads write must lie this far apart, in bytes: x86 fetches cache lines in pairs.
inline constexpr std::size_t cache_line_pair_bytes = 128;

/// The defects that tests/link seeds into ring, doorbell and channel, one at a time, to see that its checker finds
/// them.
///
/// Each names one thing that the proof rests on. Production code is instantiated with `none`, where every test of a
/// defect is a constant false. No order in this room is stronger than needed: whatever is not in this list is not
/// there.
enum class Defect : std::uint8_t {
  none,
  publish_unordered,        ///< the store of tail does not release
  peek_unordered,           ///< the load of tail does not acquire
  release_unordered,        ///< the exchange of head does not release
  room_unordered,           ///< the load of head does not acquire
  wait_unordered,           ///< the read-modify-write of head that asks to be woken does not acquire
  ring_unordered,           ///< the doorbell's exchange by who rings does not release
  arm_unordered,            ///< the doorbell's exchange by who is about to sleep does not acquire
  disarm_by_store,          ///< who need not sleep after all says so by a plain store, which forgets who rang meanwhile
  no_recheck,               ///< the sleeper does not look again after it has said that it sleeps
  flag_set_late,            ///< the sleeper looks again first and says that it sleeps only then
  capacity_off_by_one,      ///< the writer takes one unit more than there is
  early_release,            ///< a message is given back when it is returned, not when it was read
  padding_lost,             ///< the writer steps over less than the header says
  stride_not_updated,       ///< publishing goes on to the next line, and no header says so
  stride_updated_late,      ///< a header says so only once it is published
  prefetched_unreleased,    ///< the writer asks for lines that the reader has not given back
  prefetched_unpublished,   ///< the reader asks for lines that the writer has not published
  overhang_lost,            ///< a message that crosses the end of the ring is not kept in one piece
  waiting_sender_not_rung,  ///< a release does not ring the sender that waits for room
  waiting_flag_not_set,     ///< a sender that finds no room does not ask to be woken
  no_publish_when_full,     ///< a sender that finds no room keeps what it has staged
  close_without_ring,       ///< closing does not ring the other end
  deadline_not_set,         ///< who waits with a deadline sleeps without one
  deadline_not_checked,     ///< who waits with a deadline does not look at the clock
  timeout_reported_as_ready,  ///< who gave up at a deadline says that what it waited for is there
  ring_cleared_by_store,      ///< who heeds a ring loses what another told meanwhile
};

/// How long a thread looks before it says that it sleeps, and looks once more.
struct SpinPolicy {
  std::uint32_t pause_polls = 0;  ///< looks with a pause instruction after each
  std::uint32_t yield_polls = 0;  ///< looks with a sched_yield after each, after the spins
  std::uint32_t immediate_polls =
      0;  ///< looks one after another, before the spins: an answer under way takes about 150 ns
  bool poll_only_after_ring = false;  ///< spins and yields look only once somebody has rung: for looks that are dear
};

/// How a ring deals with the machine's cache lines: in bytes. Nothing but speed depends on it.
struct CacheLineTuning {
  std::size_t line = 64;  ///< a power of two of at least 16
  /// From here on the end of a message is padded to a line: that costs less than straddling lines.
  std::size_t pad_from = 1024;
  /// Before a message of at least `prefetch_from` is staged, the lines of the next `write_prefetch`, as far as the
  /// reader has given them back, are asked for, `write_prefetch_step` or more at a time: the reader has them from the
  /// last time round.
  std::size_t prefetch_from = 256;
  std::size_t write_prefetch = 4096;
  std::size_t write_prefetch_step = 1024;
  /// When a message is read, the lines of what is published behind it are asked for, up to `read_prefetch`,
  /// `read_prefetch_step` or more at a time; not behind one of at least `bulk`, whose own lines the processor foresees.
  std::size_t read_prefetch = 2048;
  std::size_t read_prefetch_step = 512;
  std::size_t no_prefetch_from = 2048;
};

/// The machine's atomics, memory and futex: what ring and doorbell run on in production.
///
/// A policy: ring, doorbell and channel reach memory that two threads share through it alone, so that the checker in
/// tests/link can run the very same code over its own. Sleeping and waking work among the threads of one process.
struct ThreadAtomics {
  static constexpr Defect defect = Defect::none;

  template <class T>
  using Atomic = std::atomic<T>;

  /// Plain access to a word of ring memory, ordered by nothing but the ring's atomics.
  static void write(std::byte* at, std::uint64_t word) noexcept { std::memcpy(at, &word, sizeof word); }
  static std::uint64_t read(const std::byte* at) noexcept {
    std::uint64_t word;
    std::memcpy(&word, at, sizeof word);
    return word;
  }

  static constexpr CacheLineTuning lines{};

  /// Prefetches a line of ring memory that this thread writes soon and that no other thread reads or writes.
  static void prefetch_for_write(const std::byte* at) noexcept { base::prefetch_for_write(at); }
  /// Prefetches a line of ring memory that is published.
  static void prefetch_for_read(const std::byte* at) noexcept { base::prefetch_for_read(at); }
  /// Prefetches a line of ring memory that the other thread may publish at this moment.
  static void prefetch_awaited(const std::byte* at) noexcept { base::prefetch_for_read(at); }

  /// Sleeps while `word` is `expected`; may return early for no reason.
  static void sleep(const Atomic<std::uint32_t>& word, std::uint32_t expected) noexcept;
  /// The same, but returns at `deadline` at the latest.
  static void sleep_until(const Atomic<std::uint32_t>& word, std::uint32_t expected,
                          std::chrono::steady_clock::time_point deadline) noexcept;
  /// Wakes whoever sleeps on `word`.
  static void wake(const Atomic<std::uint32_t>& word) noexcept;
  static bool is_past(std::chrono::steady_clock::time_point deadline) noexcept {
    return std::chrono::steady_clock::now() >= deadline;
  }

  static void pause() noexcept;
  static void yield() noexcept;

  /// A doorbell comes into being, or goes: the process has a thread more, or less, that waits on one.
  static void add_waiting_thread() noexcept;
  static void remove_waiting_thread() noexcept;
  /// How long to look before sleeping, given how many threads wait on doorbells and how many cores there are.
  static SpinPolicy spin_policy() noexcept;
};

/// The same between processes: for rings and doorbells in shared memory.
struct ProcessAtomics : ThreadAtomics {
  static void sleep(const Atomic<std::uint32_t>& word, std::uint32_t expected) noexcept;
  static void sleep_until(const Atomic<std::uint32_t>& word, std::uint32_t expected,
                          std::chrono::steady_clock::time_point deadline) noexcept;
  static void wake(const Atomic<std::uint32_t>& word) noexcept;
};

static_assert(std::atomic<std::uint64_t>::is_always_lock_free && std::atomic<std::uint32_t>::is_always_lock_free);

/// `order`, or relaxed where `defect` is seeded.
template <class Policy>
constexpr std::memory_order order_unless(Defect defect, std::memory_order order) noexcept {
  return Policy::defect == defect ? std::memory_order_relaxed : order;
}

}  // namespace ringfence::link
