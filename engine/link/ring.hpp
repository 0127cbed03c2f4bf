#pragma once

#include <cassert>
#include <cstddef>
#include <cstdint>
#include <new>

#include "link/atomics.hpp"

namespace ringfence::link {

/// The control block of a ring: the two positions that reader and writer share, each on cache lines of its own, and the
/// capacity.
///
/// A position is a number of bytes since the ring was created, a multiple of 8; the offset in the ring is the position
/// modulo the capacity. It does not overflow in practice: 2^64 bytes at 1 GB a second take 584 years. The three low
/// bits of a stored position are flags.
///
/// The word ring has two meanings: the queue, and the signal of a doorbell (see doorbell.hpp). "To request a ring" is
/// about the signal. RingWriter and RingReader have no doorbells: if RingReader::release() returns true, the
/// caller rings the writer's doorbell. `Policy` provides atomics and memory access, see ThreadAtomics.
template <class Policy>
struct RingControl {
  static constexpr std::uint64_t flags = 7;    ///< mask of the flags
  static constexpr std::uint64_t closed = 1;   ///< in tail: no message follows; in head: no message is read any more
  static constexpr std::uint64_t waiting = 2;  ///< in head: the writer's doorbell must be rung at the next release

  explicit RingControl(std::uint64_t size) noexcept : capacity(size) {}

  /// End of the published bytes. Stored by the writer only.
  alignas(cache_line_pair_bytes) typename Policy::template Atomic<std::uint64_t> tail{0};
  /// End of the released bytes. The reader exchanges it, and a writer that waits for room ORs `waiting` into it. Both
  /// are read-modify-writes, so either the release sees the flag or the writer sees the release.
  alignas(cache_line_pair_bytes) typename Policy::template Atomic<std::uint64_t> head{0};
  /// Size of the ring in bytes, a power of two. Never changes.
  alignas(cache_line_pair_bytes) std::uint64_t capacity;
};

/// A view of a ring: pointers into memory that the caller owns.
template <class Policy>
struct Ring {
  RingControl<Policy>* control;
  std::byte* bytes;  ///< starts 8 bytes before a cache line, so the payload of a message at offset 0 starts on a line
};

/// Precedes each run of messages in the ring: one word at a multiple of 8.
///
/// A run is one or more messages of one length that follow each other without a gap, each rounded up to 8 bytes. So a
/// message of 64 bytes that follows its like takes one cache line, not a line and a word of the next.
struct RunHeader {
  static constexpr std::size_t bytes = 8;

  std::uint64_t length;  ///< payload size of each message in bytes, 1 to 65536
  std::uint64_t count;   ///< number of messages, 1 to 2^20 - 1
  std::uint64_t stride;  ///< bytes from this header to the next, less than 2^24

  constexpr std::uint64_t word() const noexcept { return length | count << 20 | stride << 40; }
  static constexpr RunHeader of(std::uint64_t word) noexcept {
    return {word & 0xfffff, word >> 20 & 0xfffff, word >> 40};
  }
  /// Bytes from one message of a run to the next.
  static constexpr std::uint64_t pitch_of(std::uint64_t length) noexcept { return (length + 7) & ~std::uint64_t{7}; }
};

/// Size in bytes of the longest message in a ring of `capacity` bytes: half of it, at most 64 KiB. A message of that
/// size always fits once the reader has released enough.
constexpr std::size_t largest_message_of(std::uint64_t capacity) noexcept {
  return static_cast<std::size_t>(capacity / 2 < 65536 ? capacity / 2 : 65536);
}

/// Memory layout: the control block, a gap of 56 bytes, `capacity` bytes of ring, and the overhang.
///
/// A message may begin before the end of the ring and continue in the overhang; its run ends with it. The next message
/// begins at the position after it, modulo the capacity. So messages are contiguous, and no room is lost to padding at
/// the end of the ring. At most one unreleased message is in the overhang: a second one would end more than `capacity`
/// bytes after the start of the first one.
inline constexpr std::size_t ring_gap = 56;

/// Bytes of memory that a ring of `capacity` bytes needs.
template <class Policy>
constexpr std::size_t ring_footprint(std::uint64_t capacity) noexcept {
  const std::size_t bytes = sizeof(RingControl<Policy>) + ring_gap + capacity + largest_message_of(capacity);
  return (bytes + cache_line_pair_bytes - 1) / cache_line_pair_bytes * cache_line_pair_bytes;
}

/// The ring that make_ring created at `memory`, possibly in another process and mapped at another address.
template <class Policy>
Ring<Policy> open_ring(void* memory) noexcept {
  return {static_cast<RingControl<Policy>*>(memory),
          static_cast<std::byte*>(memory) + sizeof(RingControl<Policy>) + ring_gap};
}

/// Creates an empty ring in `memory`. `capacity` is a power of two, at least 64. `memory` has ring_footprint(capacity)
/// bytes, is aligned to cache_line_pair_bytes, and outlives the ring's writer and reader. Allocates nothing.
template <class Policy>
Ring<Policy> make_ring(void* memory, std::uint64_t capacity) noexcept {
  assert(capacity >= 64 && (capacity & (capacity - 1)) == 0);
  new (memory) RingControl<Policy>(capacity);
  return open_ring<Policy>(memory);
}

}  // namespace ringfence::link
