#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <vector>

#include "nodes/server/server_role.hpp"
#include "queries/recorded_frame.hpp"
#include "ringfence/status.hpp"

namespace ringfence::facade {

/// Complete frames that readers share: the last of them, and the history before it, without gaps.
///
/// Pins its frames while it exists. Threads: any; immutable.
class PinnedFrames {
 public:
  using Frames = std::vector<std::shared_ptr<const queries::RecordedFrame>>;
  /// In order of number, at least one.
  explicit PinnedFrames(Frames frames);
  ~PinnedFrames();
  PinnedFrames(const PinnedFrames&) = delete;
  PinnedFrames& operator=(const PinnedFrames&) = delete;

  const queries::RecordedFrame& first() const noexcept { return *frames_.front(); }
  const queries::RecordedFrame& last() const noexcept { return *frames_.back(); }

  /// A time that a query asks about: `fraction` (0 to 1, exclusive) on the way from `frame` to `next`. `next` is null
  /// if the fraction is 0.
  struct Moment {
    const queries::RecordedFrame* frame = nullptr;
    const queries::RecordedFrame* next = nullptr;
    double fraction = 0;
  };
  /// Returns frame_expired if the frame is older than the history; bad_number if it is newer than the last frame, or
  /// not a number.
  Status find(double number, Moment& moment) const noexcept;
  /// An index of several frames that covers `number`, the number of one of these frames; null if there is none, because
  /// its block of frames is not complete. Builds it if this is the first query that needs it. May throw std::bad_alloc.
  const queries::SweptFrames* swept(std::uint64_t number) const;

 private:
  Frames frames_;
};

/// The frames of a World that queries can ask about, and memory for the next ones.
///
/// Blocks are the frames 0 to 7, 8 to 15 and so on. A block is complete when the frame after it has been recorded.
///
/// Threads: the one that calls World. Readers on other threads share ownership of their frames, which may outlive the
/// World. Memory: WorldConfig::history + 1 frames, and as many more as readers pin.
class FrameStore {
 public:
  /// Keeps `history` frames beside the last one.
  FrameStore(std::shared_ptr<const geometry::ShapeTable> shapes, std::size_t history)
      : shapes_(std::move(shapes)), history_(history) {}
  FrameStore(const FrameStore&) = delete;
  FrameStore& operator=(const FrameStore&) = delete;

  /// Whether each frame is to be recorded.
  bool keeps_history() const noexcept { return history_ != 0; }
  /// Whether frame `number` is the last that was recorded.
  bool has(std::uint64_t number) const noexcept { return !kept_.empty() && kept_.back()->number() == number; }
  /// Records the objects after the last frame of the server, unless has(number). May throw std::bad_alloc; then the
  /// frame is not recorded.
  void record(const nodes::ServerRole& server, std::uint64_t number);
  /// The last frame that was recorded, with the history before it. Precondition: there is one. May throw
  /// std::bad_alloc.
  std::shared_ptr<const PinnedFrames> pin();
  /// Another frame is complete: without a history, queries can ask about frames before it only if a reader has pinned
  /// them. Returns the number of the oldest frame that is still in use; RecordedFrame::none if there is none.
  std::uint64_t drop_obsolete();

 private:
  std::shared_ptr<queries::RecordedFrame> take_free();
  void move_block(std::uint64_t number, queries::RecordedFrame& frame);

  std::shared_ptr<const geometry::ShapeTable> shapes_;
  std::shared_ptr<queries::LastOrder> order_ = std::make_shared<queries::LastOrder>();
  std::size_t history_;
  std::vector<std::shared_ptr<queries::RecordedFrame>> kept_;  ///< in order of number, without gaps
  std::vector<std::shared_ptr<queries::RecordedFrame>> free_;  ///< no longer kept; readers may have pinned them
  std::vector<std::unique_ptr<queries::RecordedFrame::BlockIndex>> free_blocks_;
  std::weak_ptr<const PinnedFrames> pinned_;  ///< of the last frame, as long as a reader has it
};

}  // namespace ringfence::facade
