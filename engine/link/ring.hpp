#pragma once

#include <cassert>
#include <cstddef>
#include <cstdint>
#include <new>
#include <span>

#include "link/atomics.hpp"

namespace ringfence::link {

/// The two words of a ring that both sides touch, each on lines of its own, and its size.
///
/// A position counts the bytes that ever passed it, in multiples of 8; it never wraps (2^64 bytes last for centuries).
/// The three low bits are flags.
template <class Policy>
struct RingControl {
  static constexpr std::uint64_t flags = 7;
  static constexpr std::uint64_t closed = 1;   ///< in tail: no message follows; in head: none is read any more
  static constexpr std::uint64_t waiting = 2;  ///< in head: the writer wants to know of the next release

  explicit RingControl(std::uint64_t size) noexcept : capacity(size) {}

  /// What is published. Written by the writer alone.
  alignas(cache_line_pair_bytes) typename Policy::template Atomic<std::uint64_t> tail{0};
  /// What is released. Exchanged by the reader, and or-ed by a writer that waits: read-modify-writes only, so a release
  /// either sees that the writer waits or is seen by it.
  alignas(cache_line_pair_bytes) typename Policy::template Atomic<std::uint64_t> head{0};
  /// In bytes, a power of two. Never changes.
  alignas(cache_line_pair_bytes) std::uint64_t capacity;
};

/// Where a ring lies: no more than pointers into memory that somebody else owns.
template <class Policy>
struct Ring {
  RingControl<Policy>* words;
  std::byte* bytes;  ///< 8 bytes before a cache line, so that what follows a header at offset 0 begins one
};

/// What stands before each message in the ring: 8 bytes, at a multiple of 8.
struct MessageHeader {
  std::uint32_t length;  ///< of the message, in bytes, not 0
  std::uint32_t stride;  ///< from this header to the next
};

/// The longest message of a ring of `capacity` bytes: half of it, 64 KiB at most. One that long always fits at last.
constexpr std::size_t largest_message_of(std::uint64_t capacity) noexcept {
  return static_cast<std::size_t>(capacity / 2 < 65536 ? capacity / 2 : 65536);
}

/// Layout: the words, a gap of 56 bytes, `capacity` bytes that positions go round, and the overhang.
///
/// A message may begin just before the end and lie in the overhang for the rest; the next one then begins where it
/// would have ended, counted round. So no message is cut and no room is lost to padding at the end. Two messages are
/// never in the overhang at once: the second would end more than `capacity` after the first began.
inline constexpr std::size_t ring_gap = 56;

/// How much memory a ring of `capacity` bytes takes.
template <class Policy>
constexpr std::size_t ring_footprint(std::uint64_t capacity) noexcept {
  const std::size_t all = sizeof(RingControl<Policy>) + ring_gap + capacity + largest_message_of(capacity);
  return (all + cache_line_pair_bytes - 1) / cache_line_pair_bytes * cache_line_pair_bytes;
}

/// Finds the ring that make_ring made at `memory`, perhaps in another process and at another address.
template <class Policy>
Ring<Policy> open_ring(void* memory) noexcept {
  return {static_cast<RingControl<Policy>*>(memory),
          static_cast<std::byte*>(memory) + sizeof(RingControl<Policy>) + ring_gap};
}

/// Makes an empty ring of `capacity` bytes, a power of two of at least 64, in `memory`: ring_footprint(capacity) bytes,
/// aligned to cache_line_pair_bytes, which outlive the ring's writer and reader.
template <class Policy>
Ring<Policy> make_ring(void* memory, std::uint64_t capacity) noexcept {
  assert(capacity >= 64 && (capacity & (capacity - 1)) == 0);
  new (memory) RingControl<Policy>(capacity);
  return open_ring<Policy>(memory);
}

/// The writing end of a ring: one thread's.
///
/// Keeps its own position, what it has published, and the reader's position as last seen, on lines that nobody else
/// touches; it looks at the reader's word only when by what it last saw there is no room. Lines that it will write are
/// asked for ahead (CacheLineTuning): with the reader doing the same, 38 million messages of 16 to 1024 bytes a second
/// instead of 29, on two cores of a Xeon at 2.6 GHz.
///
/// A writer that takes over a ring (its predecessor was killed) goes on after the last message that was published; what
/// was only staged is gone, whole.
///
/// Method: Lamport's queue (1983) with cached positions and batched publication (FastForward, Liberty, B-Queue), a
/// length before each message as in Aeron's buffers.
template <class Policy>
class RingWriter {
 public:
  explicit RingWriter(Ring<Policy> ring) noexcept
      : words_(ring.words),
        bytes_(ring.bytes),
        mask_(ring.words->capacity - 1),
        room_(ring.words->capacity + (Policy::defect == Defect::capacity_off_by_one ? 8 : 0)),
        largest_(largest_message_of(ring.words->capacity)) {
    tail_ = published_ = words_->tail.load(std::memory_order_relaxed) & ~RingControl<Policy>::flags;
    see(words_->head.load(std::memory_order_acquire));
  }

  std::size_t largest_message() const noexcept { return largest_; }

  /// Room for a message of `size` bytes, 1 to largest_message(), or null. Aligned to 8 bytes; to a cache line after a
  /// message of at least 1 KiB, and at the start; after a small one that was published alone, in one line as far as a
  /// message like it fits.
  std::byte* claim(std::size_t size) noexcept {
    if (size > largest_ || !fits(size)) [[unlikely]]
      return nullptr;
    return payload();
  }

  /// The same, after a look at how far the reader is.
  std::byte* claim_after_refresh(std::size_t size) noexcept {
    // Pairs with the exchange in RingReader::release: the reader is done with what lies before the position.
    see(words_->head.load(order_unless<Policy>(Defect::room_unordered, std::memory_order_acquire)));
    return claim(size);
  }

  /// The same, when claim_after_refresh has just found no room: asks the reader to say (release returns true) when it
  /// next releases. Costs a read-modify-write only where that has not been asked for already.
  std::byte* claim_or_request_ring(std::size_t size) noexcept {
    if constexpr (Policy::defect == Defect::waiting_flag_not_set) return nullptr;
    if (head_flags_ != 0) return nullptr;
    see(words_->head.fetch_or(RingControl<Policy>::waiting,
                              order_unless<Policy>(Defect::wait_unordered, std::memory_order_acquire)));
    return claim(size);
  }

  /// Ends the claimed message after `used` bytes; 0 gives the claim up. Nobody sees it before publish().
  void commit(std::size_t used) noexcept {
    assert(used <= largest_);
    if (used == 0) return;
    const std::uint64_t next = after(used);
    write_header(tail_, used, next - tail_);
    last_ = tail_;
    last_used_ = used;
    tail_ = Policy::defect == Defect::padding_lost ? tail_ + sizeof(MessageHeader) + used : next;
    if (used >= lines.prefetch_from) prefetch_ahead();
  }

  /// Bytes staged since the last publish, headers and padding included.
  std::uint64_t staged() const noexcept { return tail_ - published_; }

  /// Shows the reader everything staged, by one store. Voids a claim that is not committed.
  void publish() noexcept {
    const std::uint64_t next = tail_ == published_ ? tail_ : line_for_another();
    const auto tell_line = [&] {
      if (next != tail_) write_header(last_, last_used_, next - last_);
    };
    if constexpr (Policy::defect != Defect::stride_not_updated && Policy::defect != Defect::stride_updated_late)
      tell_line();
    // Pairs with the load in RingReader::available: the messages before the position are complete.
    words_->tail.store(next | closed_, order_unless<Policy>(Defect::publish_unordered, std::memory_order_release));
    if constexpr (Policy::defect == Defect::stride_updated_late) tell_line();
    published_ = tail_ = next;
  }

  /// Publishes, and says that no message follows.
  void close() noexcept {
    closed_ = RingControl<Policy>::closed;
    publish();
  }

  /// Whether the reader has closed.
  bool reader_closed() const noexcept {
    return (words_->head.load(std::memory_order_relaxed) & RingControl<Policy>::closed) != 0;
  }

 private:
  static constexpr CacheLineTuning lines = Policy::lines;
  static_assert(lines.line >= 16 && (lines.line & (lines.line - 1)) == 0);

  void write_header(std::uint64_t position, std::size_t used, std::uint64_t stride) noexcept {
    Policy::write(bytes_ + (position & mask_), std::uint64_t{used} | stride << 32);
  }

  /// Where the next message is to begin, when messages like the last are sent one by one: where it lies in one line
  /// with its header, so that the reader fetches one line for it, and not two. For small ones; else the same place.
  std::uint64_t line_for_another() const noexcept {
    const std::uint64_t stride = tail_ - last_;
    // Positions count from sizeof(MessageHeader) before a line.
    const std::uint64_t in_line = (tail_ - sizeof(MessageHeader)) % lines.line;
    return stride <= lines.line && in_line + stride > lines.line ? tail_ + lines.line - in_line : tail_;
  }

  void prefetch_ahead() noexcept {
    std::uint64_t end = tail_ + lines.write_prefetch;
    if (prefetched_ + lines.write_prefetch_step > end) return;
    // Never lines that the reader may still be at.
    const std::uint64_t free = head_seen_ + mask_ + 1 - lines.line;
    if (end > free && Policy::defect != Defect::prefetched_unreleased) end = free;
    // Nor the line that the last message ends in.
    if (prefetched_ < tail_ + lines.line) prefetched_ = tail_ + lines.line;
    for (; prefetched_ < end; prefetched_ += lines.line) Policy::prefetch_for_write(bytes_ + (prefetched_ & mask_));
  }

  /// The position after a message of `size` bytes at tail_.
  std::uint64_t after(std::size_t size) const noexcept {
    const std::uint64_t rounding = size < lines.pad_from ? 7 : lines.line - 1;
    return (tail_ + sizeof(MessageHeader) + size + rounding) & ~rounding;
  }

  bool fits(std::size_t size) const noexcept { return after(size) - head_seen_ <= room_; }

  std::byte* payload() const noexcept {
    if constexpr (Policy::defect == Defect::overhang_lost) return bytes_ + ((tail_ + sizeof(MessageHeader)) & mask_);
    return bytes_ + (tail_ & mask_) + sizeof(MessageHeader);
  }

  void see(std::uint64_t head) noexcept {
    head_seen_ = head & ~RingControl<Policy>::flags;
    head_flags_ = head & RingControl<Policy>::flags;
  }

  RingControl<Policy>* words_;
  std::byte* bytes_;
  std::uint64_t mask_;
  std::uint64_t room_;
  std::size_t largest_;
  std::uint64_t tail_;
  std::uint64_t head_seen_;
  std::uint64_t head_flags_ = 0;  ///< seen with it: the reader has been asked already, or has closed
  std::uint64_t published_;
  std::uint64_t last_ = 0;        ///< where the last message that was committed begins
  std::size_t last_used_ = 0;     ///< and how long it is
  std::uint64_t prefetched_ = 0;  ///< up to here lines have been asked for
  std::uint64_t closed_ = 0;
};

/// The reading end of a ring: one thread's. A reader that takes over goes on after what was released last.
template <class Policy>
class RingReader {
 public:
  explicit RingReader(Ring<Policy> ring) noexcept
      : words_(ring.words), bytes_(ring.bytes), mask_(ring.words->capacity - 1) {
    read_ = released_ = tail_seen_ = words_->head.load(std::memory_order_relaxed) & ~RingControl<Policy>::flags;
  }

  /// Whether a message is there. Looks at the writer's word only when all it knew of has been read.
  bool available() noexcept {
    if (read_ != tail_seen_) return true;
    // Pairs with the store in RingWriter::publish: what lies before the position can be read.
    const std::uint64_t tail =
        words_->tail.load(order_unless<Policy>(Defect::peek_unordered, std::memory_order_acquire));
    tail_seen_ = tail & ~RingControl<Policy>::flags;
    ended_ = (tail & RingControl<Policy>::closed) != 0;
    if (read_ != tail_seen_) return true;
    // Whoever looks again finds the message and its position together. With messages that begin at lines a round trip
    // took 313 ns instead of 358 in one run, 330 instead of 361 in another.
    Policy::prefetch_awaited(bytes_ + (read_ & mask_));
    return false;
  }

  /// Asks for the lines that available() and next() look at.
  void prefetch() const noexcept {
    Policy::prefetch_awaited(reinterpret_cast<const std::byte*>(&words_->tail));
    Policy::prefetch_awaited(bytes_ + (read_ & mask_));
  }

  /// The next message; precondition: available(). Lives until release().
  std::span<const std::byte> next() noexcept {
    const std::byte* at = bytes_ + (read_ & mask_);
    const std::uint64_t header = Policy::read(at);
    const std::uint64_t stride = header >> 32;
    read_ += stride;
    if (stride < lines.no_prefetch_from) prefetch_ahead();
    return {at + sizeof(MessageHeader), static_cast<std::uint32_t>(header)};
  }

  /// Gives back everything that next() returned. True when the writer asked to be told.
  bool release() noexcept {
    if (read_ == released_) return false;
    released_ = read_;
    // Pairs with the writer's load and fetch_or: what was read lies before the position and may be written over.
    const std::uint64_t before = words_->head.exchange(
        read_ | closed_, order_unless<Policy>(Defect::release_unordered, std::memory_order_release));
    return (before & RingControl<Policy>::waiting) != 0;
  }

  /// Whether, as far as available() last saw, the writer has closed and its last message has been read.
  bool ended() const noexcept { return ended_ && read_ == tail_seen_; }

  /// Says that nothing more is read.
  void close() noexcept {
    closed_ = RingControl<Policy>::closed;
    words_->head.fetch_or(RingControl<Policy>::closed, std::memory_order_relaxed);
  }

 private:
  static constexpr CacheLineTuning lines = Policy::lines;

  void prefetch_ahead() noexcept {
    std::uint64_t end = read_ + lines.read_prefetch;
    if (prefetched_ + lines.read_prefetch_step > end) return;
    // Never lines that the writer may be at.
    if (end > tail_seen_ && Policy::defect != Defect::prefetched_unpublished) end = tail_seen_;
    if (prefetched_ < read_) prefetched_ = read_;
    for (; prefetched_ < end; prefetched_ += lines.line) Policy::prefetch_for_read(bytes_ + (prefetched_ & mask_));
  }

  RingControl<Policy>* words_;
  std::byte* bytes_;
  std::uint64_t mask_;
  std::uint64_t read_;
  std::uint64_t tail_seen_;
  std::uint64_t released_;
  std::uint64_t prefetched_ = 0;  ///< up to here lines have been asked for
  std::uint64_t closed_ = 0;
  bool ended_ = false;
};

}  // namespace ringfence::link
