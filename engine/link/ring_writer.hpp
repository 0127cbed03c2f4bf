#pragma once

#include <algorithm>
#include <cassert>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <span>

#include "link/message_stage.hpp"
#include "link/ring.hpp"

namespace ringfence::link {

/// The writing end of a ring. Used by one thread at a time.
///
/// The writer keeps its own position, the published position and the last position of the reader that it has read in
/// members, on cache lines that no other thread accesses. It reads the shared head only when the cached head leaves no
/// room. The reader does the same with the tail.
///
/// A message is *staged* from commit() to publish(). Large messages are written in place. With memory for a
/// MessageStage, small messages that are published together are put together there, those of one length as runs (see
/// RunHeader), and copied into the ring in one piece. A small message that is published alone, as the one before it
/// was, is written in place: the copy would only add to its latency. Depending on the processor, copies are streamed
/// past the caches, or lines are prefetched before they are written (see CacheLineTuning).
///
/// A new writer may take over the ring of a writer that was killed. It continues after the last published message;
/// staged messages are lost, each as a whole.
///
/// Method: Lamport's queue (1983) with cached positions and batched publication (FastForward, Liberty, B-Queue), and a
/// length before each message as in Aeron's buffers.
template <class Policy>
class RingWriter {
 public:
  /// `stage` is empty or as MessageStage demands; it limits the size of the messages that are staged.
  explicit RingWriter(Ring<Policy> ring, std::span<std::byte> stage = {}) noexcept
      : control_(ring.control),
        bytes_(ring.bytes),
        mask_(ring.control->capacity - 1),
        usable_bytes_(ring.control->capacity + (Policy::defect == Defect::capacity_off_by_one ? 8 : 0)),
        largest_(largest_message_of(ring.control->capacity)),
        stage_up_to_(std::min(Policy::streams_copies() ? lines.stream_up_to : lines.stage_up_to,
                              MessageStage<Policy>::largest_message_of(stage.size()))),
        stage_alone_from_(Policy::streams_copies() ? lines.stream_from : largest_ + 1),
        stage_(stage),
        prefetches_(!Policy::streams_copies()) {
    tail_ = published_ = control_->tail.load(std::memory_order_relaxed) & ~RingControl<Policy>::flags;
    stage_.start_at(tail_);
    set_head_seen(control_->head.load(std::memory_order_acquire));
  }

  std::size_t largest_message() const noexcept { return largest_; }

  /// Returns room for a message of `size` bytes (1 to largest_message()), or null if the cached head leaves no room or
  /// `size` is too large. The room is valid until commit(), publish() or the next claim.
  ///
  /// It is aligned to 8 bytes; at the start of the ring and after a message of at least 1 KiB, to a cache line. After a
  /// small message that was published alone, a message of the same size lies within one line.
  std::byte* claim(std::size_t size) noexcept {
    assert(size != 0);
    claimed_in_run_ = size == run_.length && tail_ <= run_.last_start;
    if (claimed_in_run_) return stage_.at(tail_);
    if (size > largest_ || !fits(size)) [[unlikely]]
      return nullptr;
    claimed_in_stage_ = size <= stage_up_to_ && (batching_ || size >= stage_alone_from_);
    return claimed_in_stage_ ? room_in_stage(size) : room_in_ring();
  }

  /// Like claim(), after an update of the cached head.
  std::byte* claim_after_refresh(std::size_t size) noexcept {
    // Pairs with the exchange in RingReader::release: the reader has finished with everything before this position.
    set_head_seen(control_->head.load(order_unless<Policy>(Defect::room_unordered, std::memory_order_acquire)));
    return claim(size);
  }

  /// Like claim(), for use when claim_after_refresh() has found no room: requests a ring of the writer's doorbell, that
  /// is, the reader's next release() returns true. Returns null if the reader has closed or a request is pending;
  /// otherwise this costs one read-modify-write.
  std::byte* claim_or_request_ring(std::size_t size) noexcept {
    if constexpr (Policy::defect == Defect::waiting_flag_not_set) return nullptr;
    if (head_flags_ != 0) return nullptr;
    set_head_seen(control_->head.fetch_or(RingControl<Policy>::waiting,
                                          order_unless<Policy>(Defect::wait_unordered, std::memory_order_acquire)));
    return claim(size);
  }

  /// Ends the claimed message after `used` bytes, at most the size claimed; 0 cancels the claim. The message is not
  /// visible before publish().
  void commit(std::size_t used) noexcept {
    assert(used <= largest_);
    if (claimed_in_run_ && (used == run_.length || Policy::defect == Defect::length_of_run_not_checked)) {
      ++last_.count;
      tail_ += run_.pitch;
      return;
    }
    if (used == 0) return;
    claimed_in_stage_ ? commit_in_stage(used) : commit_in_ring(used);
  }

  /// Bytes staged since the last publish(), including headers and padding.
  std::uint64_t staged() const noexcept { return tail_ - published_; }

  /// Makes all staged messages visible to the reader by one store. Cancels a claim that has not been committed.
  void publish() noexcept {
    const std::uint64_t next = tail_ == published_ ? tail_ : next_message_start();
    batching_ = tail_ != published_ && (last_.count > 1 || last_at_ != published_);
    if constexpr (Policy::defect != Defect::stride_not_updated && Policy::defect != Defect::stride_updated_late)
      extend_last_run(next);
    if constexpr (Policy::defect != Defect::stage_copied_late) empty_stage_with_padding(next);
    // Pairs with the load in RingReader::available: all messages before this position are complete.
    control_->tail.store(next | closed_, order_unless<Policy>(Defect::publish_unordered, std::memory_order_release));
    if constexpr (Policy::defect == Defect::stride_updated_late) extend_last_run(next);
    if constexpr (Policy::defect == Defect::stage_copied_late) empty_stage_with_padding(next);
    published_ = tail_ = next;
    stage_.start_at(next);
  }

  /// Publishes all staged messages and marks the end of the stream.
  void close() noexcept {
    closed_ = RingControl<Policy>::closed;
    publish();
  }

  /// Whether the reader has closed.
  bool reader_closed() const noexcept {
    return (control_->head.load(std::memory_order_relaxed) & RingControl<Policy>::closed) != 0;
  }

 private:
  static constexpr CacheLineTuning lines = Policy::lines;
  static_assert(lines.line >= 16 && (lines.line & (lines.line - 1)) == 0);

  /// The messages that may continue the last run.
  struct Continuation {
    std::uint64_t length = 0;      ///< their length; 0: none may
    std::uint64_t pitch = 0;       ///< bytes from one to the next
    std::uint64_t last_start = 0;  ///< the last position where one may start
  };

  std::byte* ring_at(std::uint64_t position) const noexcept { return bytes_ + (position & mask_); }

  /// The room of a message in place. What is staged precedes it.
  std::byte* room_in_ring() noexcept {
    if constexpr (Policy::defect != Defect::stage_overtaken) empty_stage();
    if constexpr (Policy::defect == Defect::overhang_lost) return ring_at(tail_ + RunHeader::bytes);
    return ring_at(tail_) + RunHeader::bytes;
  }

  void commit_in_ring(std::size_t used) noexcept {
    const std::uint64_t next = after(used);
    last_at_ = tail_;
    last_ = {used, 1, next - tail_};
    Policy::write(ring_at(tail_), last_.word());
    tail_ = Policy::defect == Defect::padding_lost ? tail_ + RunHeader::bytes + used : next;
    if (Policy::defect != Defect::stage_overtaken || !run_is_open_) stage_.start_at(tail_);
    batching_ = true;
    if (used >= lines.prefetch_from) prefetch_ahead();
  }

  std::byte* room_in_stage(std::size_t size) noexcept {
    if (after(size) > stage_.end()) empty_stage();
    return stage_.at(tail_) + RunHeader::bytes;
  }

  void commit_in_stage(std::size_t used) noexcept {
    // The message is shorter than those of the run that it was to continue, so it gets a header.
    if (claimed_in_run_) std::memmove(stage_.at(tail_) + RunHeader::bytes, stage_.at(tail_), used);
    end_run(tail_);
    last_at_ = tail_;
    last_ = {used, 1, 0};
    run_is_open_ = true;
    tail_ = after(used);
    prefetch_ahead();
    // The message may continue in the overhang, and the next one does not follow it in memory.
    if ((tail_ & mask_) < (last_at_ & mask_) && Policy::defect != Defect::stage_crosses_end) return empty_stage();
    if (used < lines.pad_from) let_run_continue();
  }

  /// Lets messages of the last one's length follow it without a header of their own, as long as each has room in the
  /// ring and in the stage, also if it gets a header in the end, and ends before the end of the ring.
  void let_run_continue() noexcept {
    run_.length = last_.length;
    run_.pitch = RunHeader::pitch_of(last_.length);
    const std::uint64_t lap_end = Policy::defect == Defect::stage_crosses_end ? ~std::uint64_t{0} : (tail_ | mask_);
    const std::uint64_t end = std::min({stage_.end(), head_seen_ + usable_bytes_, lap_end});
    run_.last_start = end - std::min(end, run_.pitch + RunHeader::bytes);
  }

  /// Writes the header of the run in the stage, if there is one: the next run starts at `next`.
  void end_run(std::uint64_t next) noexcept {
    if (!run_is_open_) return;
    run_is_open_ = false;
    run_.length = 0;
    last_.stride = next - last_at_;
    Policy::write(stage_.at(last_at_), last_.word());
  }

  void empty_stage() noexcept {
    if (stage_.begin() == tail_) return;
    end_run(tail_);
    stage_.copy_to(ring_at(stage_.begin()), tail_);
  }

  /// Also copies what fills the last line before `next`, if the ring has room: lines that are written as a whole cost
  /// less.
  void empty_stage_with_padding(std::uint64_t next) noexcept {
    if (stage_.begin() == tail_) return;
    end_run(next);
    stage_.copy_to(ring_at(stage_.begin()), next - head_seen_ <= usable_bytes_ ? next : tail_);
  }

  /// Lets the next run start at `next`, not at tail_.
  void extend_last_run(std::uint64_t next) noexcept {
    if (run_is_open_) return end_run(next);
    if (next == tail_) return;
    last_.stride = next - last_at_;
    Policy::write(ring_at(last_at_), last_.word());
  }

  /// The position where the next message starts. If the last message is small and another one of its size would cross
  /// the end of a cache line, this is the start of the next line: then the reader fetches one line for that message and
  /// its header, not two. It is the start of a line too after messages that are copied from the stage, so that lines
  /// are written as a whole. Otherwise it is the position after the last message.
  std::uint64_t next_message_start() const noexcept {
    const std::uint64_t stride = RunHeader::bytes + RunHeader::pitch_of(last_.length);
    // Cache lines start at positions RunHeader::bytes above a multiple of the line size.
    const std::uint64_t in_line = (tail_ - RunHeader::bytes) % lines.line;
    const bool skips = (stride <= lines.line && in_line + stride > lines.line) || (run_is_open_ && in_line != 0);
    return skips ? tail_ + lines.line - in_line : tail_;
  }

  void prefetch_ahead() noexcept {
    if (!prefetches_) return;
    std::uint64_t end = tail_ + lines.write_prefetch;
    if (prefetched_ + lines.write_prefetch_step > end) return;
    // Exclude lines that the reader may still use.
    const std::uint64_t free = head_seen_ + mask_ + 1 - lines.line;
    if (end > free && Policy::defect != Defect::prefetched_unreleased) end = free;
    // Exclude the line that the last message ends in.
    if (prefetched_ < tail_ + lines.line) prefetched_ = tail_ + lines.line;
    for (; prefetched_ < end; prefetched_ += lines.line) Policy::prefetch_for_write(ring_at(prefetched_));
  }

  /// The position after a message of `size` bytes at tail_ with a header of its own.
  std::uint64_t after(std::size_t size) const noexcept {
    const std::uint64_t rounding = size < lines.pad_from ? 7 : lines.line - 1;
    return (tail_ + RunHeader::bytes + size + rounding) & ~rounding;
  }

  bool fits(std::size_t size) const noexcept { return after(size) - head_seen_ <= usable_bytes_; }

  void set_head_seen(std::uint64_t head) noexcept {
    head_seen_ = head & ~RingControl<Policy>::flags;
    head_flags_ = head & RingControl<Policy>::flags;
  }

  RingControl<Policy>* control_;
  std::byte* bytes_;
  std::uint64_t mask_;
  std::uint64_t usable_bytes_;
  std::size_t largest_;
  std::size_t stage_up_to_;       ///< messages of up to this size are staged; 0: none
  std::size_t stage_alone_from_;  ///< messages of at least this size also if they are published alone
  std::uint64_t tail_;            ///< position of the next message
  std::uint64_t head_seen_;       ///< the cached head
  std::uint64_t head_flags_ = 0;  ///< flags of the cached head: `waiting` is already set, or the reader has closed
  std::uint64_t published_;       ///< end of the published bytes
  RunHeader last_{};              ///< the last run
  std::uint64_t last_at_ = 0;     ///< position of its header
  std::uint64_t prefetched_ = 0;  ///< end of the prefetched lines
  std::uint64_t closed_ = 0;
  Continuation run_;
  MessageStage<Policy> stage_;     ///< holds the bytes from stage_.begin() to tail_; empty if they are equal
  bool prefetches_;                ///< lines are prefetched before they are written
  bool run_is_open_ = false;       ///< the last run is in the stage, and its header is not written yet
  bool batching_ = false;          ///< another message is staged, or several were published together last time
  bool claimed_in_stage_ = false;  ///< the room of the last claim is in the stage
  bool claimed_in_run_ = false;    ///< and directly after the last message, without room for a header
};

}  // namespace ringfence::link
