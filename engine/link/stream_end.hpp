#pragma once

#include <atomic>
#include <cstdint>
#include <utility>

#include "link/atomics.hpp"

namespace ringfence::link {

/// Whether the owner of one end of a stream sleeps: the word of a doorbell (see doorbell.hpp), for an owner that also
/// waits for file descriptors and that the other end wakes by one of them.
///
/// Every change is an exchange, so rings and sleeps are ordered by this one word, as in a doorbell. Threads: the owner
/// calls arm() and disarm(), the other end ring().
template <class Policy>
class WakeFlag {
 public:
  /// Returns whether the owner sleeps and must be woken. What the caller did before is visible to the owner after its
  /// next arm().
  [[nodiscard]] bool ring() noexcept {
    // Pairs with the exchange in arm().
    return state_.exchange(rung, order_unless<Policy>(Defect::ring_unordered, std::memory_order_release)) == asleep;
  }
  /// From now on ring() returns true once. The owner tests its condition after this, and before it sleeps.
  void arm() noexcept {
    // Pairs with ring(): the test that follows sees what was done before any ring that this exchange overwrites.
    state_.exchange(asleep, order_unless<Policy>(Defect::arm_unordered, std::memory_order_acquire));
  }
  /// The owner is awake, so ring() returns false.
  void disarm() noexcept {
    if constexpr (Policy::defect == Defect::disarm_by_store) {
      state_.store(awake, std::memory_order_relaxed);
    } else {
      // An exchange, not a store: it continues the release sequence of a ring that it overwrites, for the next arm().
      state_.exchange(awake, std::memory_order_relaxed);
    }
  }

 private:
  enum State : std::uint32_t { awake, asleep, rung };

  typename Policy::template Atomic<std::uint32_t> state_{awake};
};

/// The positions of one direction of a stream: numbers of bytes since its start, multiples of 8. The offset in the
/// memory of the direction is the position modulo its capacity. The three low bits of a stored position are flags.
template <class Policy>
struct StreamPositions {
  static constexpr std::uint64_t flags = 7;    ///< mask of the flags
  static constexpr std::uint64_t waiting = 1;  ///< in head: the writer must be rung at the next release

  /// End of the published bytes. Stored by the writer only.
  alignas(cache_line_pair_bytes) typename Policy::template Atomic<std::uint64_t> tail{0};
  /// End of the released bytes. The reader exchanges it, and a writer that waits for room ORs `waiting` into it. Both
  /// are read-modify-writes, so either the release sees the flag or the writer sees the release.
  alignas(cache_line_pair_bytes) typename Policy::template Atomic<std::uint64_t> head{0};
};

/// What the two ends of a stream share besides the bytes: for each end the positions of the direction that it writes,
/// and whether its owner sleeps.
template <class Policy>
struct StreamControl {
  struct OfEnd {
    StreamPositions<Policy> written;
    alignas(cache_line_pair_bytes) WakeFlag<Policy> flag;
  };
  OfEnd ends[2];
};

/// One end of a stream of bytes in both directions between two processes that share memory. The memory of the bytes is
/// the caller's: this class only says which positions may be written and read.
///
/// The other process is not trusted. This class reads nothing from the shared memory but positions, and refuses those
/// that are not possible (is_broken()); so what available() and room() return is never more than the capacity. Bytes
/// at positions that may be read can still change at any time, if the other process breaks the protocol.
///
/// A process that ends, or is killed, loses what it has staged and not published; what it published can be read.
/// Never blocks, allocates nothing. Threads: one at a time. Method: as RingWriter and RingReader (ring.hpp).
template <class Policy>
class StreamEnd {
 public:
  using Positions = StreamPositions<Policy>;

  /// End `side`, 0 or 1, of a new stream, or of one of which this end was not used yet. Capacities are powers of two.
  StreamEnd(StreamControl<Policy>& control, int side, std::uint64_t out_capacity, std::uint64_t in_capacity) noexcept
      : out_(control.ends[side].written),
        in_(control.ends[1 - side].written),
        own_flag_(control.ends[side].flag),
        other_flag_(control.ends[1 - side].flag),
        out_capacity_(out_capacity + (Policy::defect == Defect::capacity_off_by_one ? 8 : 0)),
        in_capacity_(in_capacity) {}
  StreamEnd(const StreamEnd&) = delete;
  StreamEnd& operator=(const StreamEnd&) = delete;

  /// Whether the other end has stored a position that is not possible. Then nothing more is read or sent.
  bool is_broken() const noexcept { return broken_; }

  // Sending.
  /// Position of the next byte to write.
  std::uint64_t write_position() const noexcept { return tail_; }
  /// Bytes from there on that may be written, as far as known.
  std::uint64_t room() const noexcept { return out_capacity_ - (tail_ - head_seen_); }
  /// Whether `bytes` bytes may be written. If not, the other end's next release() rings this one.
  [[nodiscard]] bool make_room(std::uint64_t bytes) noexcept {
    if (room() < bytes) {
      // Pairs with the exchange in release(): the reader has finished with everything before this position.
      see_head(out_.head.load(order_unless<Policy>(Defect::room_unordered, std::memory_order_acquire)));
    }
    if (room() < bytes && !is_requested_ && Policy::defect != Defect::waiting_flag_not_set) {
      see_head(out_.head.fetch_or(Positions::waiting,
                                  order_unless<Policy>(Defect::wait_unordered, std::memory_order_acquire)));
    }
    return room() >= bytes;
  }
  /// The next `bytes` bytes, a multiple of 8 and at most room(), are written.
  void stage(std::uint64_t bytes) noexcept { tail_ += bytes; }
  /// Makes what is staged visible. Returns whether the other end sleeps and must be woken.
  [[nodiscard]] bool publish() noexcept {
    if (tail_ == published_) {
      return false;
    }
    // Pairs with the load in refresh(): all bytes before this position are written.
    out_.tail.store(tail_, order_unless<Policy>(Defect::publish_unordered, std::memory_order_release));
    published_ = tail_;
    return other_flag_.ring();
  }

  // Receiving.
  /// Position of the next byte to read.
  std::uint64_t read_position() const noexcept { return read_; }
  /// Bytes from there on that may be read, as far as known.
  std::uint64_t available() const noexcept { return tail_seen_ - read_; }
  /// Whether refresh() would find more. Cheap.
  bool has_news() const noexcept {
    return !broken_ && position_of(in_.tail.load(std::memory_order_relaxed)) != tail_seen_;
  }
  /// Updates available(); returns whether there is more than before.
  bool refresh() noexcept {
    // Pairs with the store in publish(): everything before this position may be read.
    const std::uint64_t tail =
        position_of(in_.tail.load(order_unless<Policy>(Defect::peek_unordered, std::memory_order_acquire)));
    if (tail - released_ > in_capacity_ || tail - released_ < tail_seen_ - released_) {
      broken_ = true;
    }
    return !broken_ && tail != std::exchange(tail_seen_, tail);
  }
  /// The next `bytes` bytes, a multiple of 8 and at most available(), were read.
  void take(std::uint64_t bytes) noexcept { read_ += bytes; }
  /// Gives the room of all bytes that were taken back. Returns whether the other end sleeps and must be woken.
  [[nodiscard]] bool release() noexcept {
    if (read_ == released_) {
      return false;
    }
    released_ = read_;
    // Pairs with the load and the fetch_or of head in make_room(): everything before this position has been read.
    const std::uint64_t before =
        in_.head.exchange(read_, order_unless<Policy>(Defect::release_unordered, std::memory_order_release));
    return (before & Positions::waiting) != 0 && Policy::defect != Defect::waiting_sender_not_rung &&
           other_flag_.ring();
  }

  // Sleeping.
  /// Requests to be woken by the other end's next publish(), or by its release() if make_room() has failed. Returns
  /// false if there is already something to read or, with `awaits_room`, room to write, or if the end is broken: then
  /// the owner does not sleep.
  [[nodiscard]] bool arm(bool awaits_room) noexcept {
    const auto has_work = [&] { return has_news() || (awaits_room && make_room(8)) || broken_; };
    if constexpr (Policy::defect == Defect::flag_set_late) {
      if (has_work()) {
        return false;
      }
    }
    own_flag_.arm();
    if constexpr (Policy::defect == Defect::flag_set_late || Policy::defect == Defect::no_recheck) {
      return true;
    }
    return !has_work();
  }
  /// The owner is awake: the other end need not wake it.
  void disarm() noexcept { own_flag_.disarm(); }

 private:
  static std::uint64_t position_of(std::uint64_t stored) noexcept { return stored & ~Positions::flags; }

  // The other end releases only what was published, and never less than before.
  void see_head(std::uint64_t stored) noexcept {
    const std::uint64_t head = position_of(stored);
    broken_ = broken_ || published_ - head > published_ - head_seen_;
    head_seen_ = broken_ ? head_seen_ : head;
    is_requested_ = (stored & Positions::waiting) != 0;
  }

  Positions& out_;
  Positions& in_;
  WakeFlag<Policy>& own_flag_;
  WakeFlag<Policy>& other_flag_;
  std::uint64_t out_capacity_;
  std::uint64_t in_capacity_;
  std::uint64_t tail_ = 0;       ///< of what is staged
  std::uint64_t published_ = 0;  ///< of what is published
  std::uint64_t head_seen_ = 0;  ///< the other end's released position, as last read
  bool is_requested_ = false;    ///< `waiting` was set when `head_seen_` was read
  std::uint64_t read_ = 0;
  std::uint64_t released_ = 0;
  std::uint64_t tail_seen_ = 0;  ///< the other end's published position, as last read
  bool broken_ = false;
};

}  // namespace ringfence::link
