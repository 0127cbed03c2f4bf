#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <span>

#include "link/ring.hpp"

namespace ringfence::link {

/// The reading end of a ring. Used by one thread at a time. A new reader may take over the ring; it continues with the
/// first run of messages that has not been released (see RunHeader).
template <class Policy>
class RingReader {
 public:
  explicit RingReader(Ring<Policy> ring) noexcept
      : control_(ring.control),
        bytes_(ring.bytes),
        mask_(ring.control->capacity - 1),
        evict_from_(Policy::streams_copies() ? lines.stream_from : ~std::size_t{0}) {
    read_ = released_ = tail_seen_ = control_->head.load(std::memory_order_relaxed) & ~RingControl<Policy>::flags;
  }

  /// Whether a message is available. Reads the shared tail only when all known messages have been read.
  bool available() noexcept {
    if (left_ != 0 || read_ != tail_seen_) return true;
    // Pairs with the store in RingWriter::publish: everything before this position may be read.
    const std::uint64_t tail =
        control_->tail.load(order_unless<Policy>(Defect::peek_unordered, std::memory_order_acquire));
    tail_seen_ = tail & ~RingControl<Policy>::flags;
    ended_ = (tail & RingControl<Policy>::closed) != 0;
    if (read_ != tail_seen_) return true;
    // Prefetches the line in which the next message will start, for the next poll. With messages that start on a cache
    // line, a round trip takes 313 ns with this prefetch and 358 ns without in one run, 330 and 361 ns in another.
    Policy::prefetch_awaited(bytes_ + (read_ & mask_));
    return false;
  }

  /// Prefetches the lines that available() and next() read.
  void prefetch() const noexcept {
    Policy::prefetch_awaited(reinterpret_cast<const std::byte*>(&control_->tail));
    Policy::prefetch_awaited(bytes_ + (read_ & mask_));
  }

  /// What next() will return. Precondition: available(). Valid until release().
  std::span<const std::byte> peek() noexcept {
    if (left_ == 0) start_run();
    return {message_, length_};
  }

  /// The payload of the next message, in place. Precondition: available(). Valid until release().
  std::span<const std::byte> next() noexcept {
    const std::span<const std::byte> message = peek();
    message_ += RunHeader::pitch_of(length_);
    if (--left_ == 0) read_ = run_end_;
    return message;
  }

  /// Releases the messages that next() has returned, those of a run when its last one has been returned. Returns true
  /// if the writer waits for room: then the caller must ring the writer's doorbell.
  bool release() noexcept {
    if (read_ == released_) return false;
    evict_read_lines();
    released_ = read_;
    // Pairs with the load and the fetch_or of head in RingWriter: everything before this position has been read and may
    // be overwritten.
    const std::uint64_t before = control_->head.exchange(
        read_ | closed_, order_unless<Policy>(Defect::release_unordered, std::memory_order_release));
    return (before & RingControl<Policy>::waiting) != 0;
  }

  /// Whether the writer has closed and next() has returned its last message. Up to date after a call of available()
  /// that returned false.
  bool ended() const noexcept { return ended_ && read_ == tail_seen_; }

  /// Sets the flag that no further message is read.
  void close() noexcept {
    closed_ = RingControl<Policy>::closed;
    control_->head.fetch_or(RingControl<Policy>::closed, std::memory_order_relaxed);
  }

 private:
  static constexpr CacheLineTuning lines = Policy::lines;

  void start_run() noexcept {
    const std::byte* const header_at = bytes_ + (read_ & mask_);
    const RunHeader header = RunHeader::of(Policy::read(header_at));
    message_ = header_at + RunHeader::bytes;
    length_ = header.length;
    left_ = header.count;
    run_end_ = read_ + header.stride;
    if (header.length > lines.stream_up_to) in_place_end_ = run_end_;
    if (header.stride < lines.no_prefetch_from) prefetch_ahead();
    if constexpr (Policy::defect == Defect::run_released_early) read_ = run_end_;
  }

  /// Prefetches what is published after the run.
  void prefetch_ahead() noexcept {
    std::uint64_t end = run_end_ + lines.read_prefetch;
    if (prefetched_ + lines.read_prefetch_step > end) return;
    // Exclude lines that the writer may use.
    if (end > tail_seen_ && Policy::defect != Defect::prefetched_unpublished) end = tail_seen_;
    if (prefetched_ < run_end_) prefetched_ = run_end_;
    for (; prefetched_ < end; prefetched_ += lines.line) Policy::prefetch_for_read(bytes_ + (prefetched_ & mask_));
  }

  /// Evicts the whole lines of what is about to be released, if the writer streams copies of that size: then it need
  /// not wait until they are invalidated in the caches of this core.
  void evict_read_lines() noexcept {
    const std::uint64_t first = std::max(released_, in_place_end_);
    if (read_ - first < evict_from_) return;
    // Cache lines start at positions RunHeader::bytes above a multiple of the line size.
    std::uint64_t line = first + (RunHeader::bytes - first) % lines.line;
    if constexpr (Policy::defect == Defect::evicted_released) line -= lines.line;
    for (; line + lines.line <= read_; line += lines.line) Policy::evict(bytes_ + (line & mask_));
  }

  RingControl<Policy>* control_;
  std::byte* bytes_;
  std::uint64_t mask_;
  std::size_t evict_from_;  ///< lines are evicted in releases of at least this size
  std::uint64_t read_;      ///< start of the run that is being read, or of the next one
  std::uint64_t tail_seen_;
  std::uint64_t released_;
  std::uint64_t run_end_ = 0;           ///< position after the run that is being read
  std::uint64_t in_place_end_ = 0;      ///< position after the last message that is too long to be streamed
  std::uint64_t left_ = 0;              ///< messages of that run that are not read yet
  std::uint64_t length_ = 0;            ///< of each of its messages
  const std::byte* message_ = nullptr;  ///< the next of them
  std::uint64_t prefetched_ = 0;        ///< end of the prefetched lines
  std::uint64_t closed_ = 0;
  bool ended_ = false;
};

}  // namespace ringfence::link
