#pragma once

#include <atomic>
#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <utility>
#include <vector>

#include "base/flat_list.hpp"
#include "base/prefetch.hpp"
#include "geometry/shape_table.hpp"
#include "queries/frame_part.hpp"
#include "queries/lazy_index.hpp"
#include "queries/swept_frames.hpp"

namespace ringfence::queries {

/// The present objects of one complete frame, as queries read them, with the indexes that its queries have built.
///
/// Indexes: one of the objects where they stand; one of their ways to the next frame, for times between the two; and,
/// if the frame is the last of a block, that of the block. Each is built by the first query that needs it. Rows of
/// objects that have not changed are kept for the next frame that is recorded here, with their places in the first
/// index.
///
/// Threads: one thread records, while no reader has pinned the frame; then all const functions by any number of
/// threads, which wait for each other only while an index is built. Memory: kept between frames; 74 to 102 bytes
/// for each slot, and 30 to 100 for each object and index.
class RecordedFrame {
 public:
  /// `shapes` is that of the world; the frame reads the shapes that it has when it is recorded. `order`: shared by all
  /// frames of the world.
  RecordedFrame(std::shared_ptr<const geometry::ShapeTable> shapes, std::shared_ptr<LastOrder> order)
      : shapes_(std::move(shapes)), order_(std::move(order)), view_(shapes_->view()) {}

  /// Number of the frame, or none.
  std::uint64_t number() const noexcept { return number_; }
  static constexpr std::uint64_t none = ~std::uint64_t{0};

  // Recording.
  /// Begins frame `number`: number() is none until finish(). What was recorded here before is still there: returns the
  /// number of that frame, or none if every slot is to be set. May throw std::bad_alloc; then nothing is left.
  std::uint64_t begin(std::size_t slots, std::uint64_t number);
  /// After begin(), always or never: the bounds of all rows are set too, so that the index need not compute them.
  /// `space` is that of the world, `origin` a place in the midst of the objects. May throw std::bad_alloc.
  void begin_bounds(const geometry::FixedSpace& space, const Vec3d& origin);
  /// The row of a slot, to set it and all that belongs to it. Its number is 0 if the slot has no present object.
  FrameObject& row(std::uint32_t slot) noexcept {
    changed_[slot] = 1;
    return rows_[slot];
  }
  /// What the caller has noted about the row of a slot when it was set; 0 at first.
  std::uint8_t& source(std::uint32_t slot) noexcept { return sources_[slot]; }
  void prefetch_row(std::uint32_t slot) const noexcept { base::prefetch_for_write(&rows_[slot]); }
  void set_bounds(std::uint32_t slot, const RowBounds& bounds) noexcept { bounds_[slot] = bounds; }
  void prefetch_bounds(std::uint32_t slot) const noexcept { base::prefetch_for_write(&bounds_[slot]); }
  void set_user_data(std::uint32_t slot, std::uint64_t data) noexcept { user_data_[slot] = data; }
  /// The frame is complete, with so many present objects.
  void finish(std::uint64_t number, std::size_t objects) noexcept;

  /// The index of a block of frames; null in a frame that is not the last of one. It moves from frame to frame, because
  /// few frames need its memory. May only be changed while no reader has pinned the frame.
  using BlockIndex = LazyIndex<SweptFrames>;
  std::unique_ptr<BlockIndex>& block() noexcept { return block_; }

  // Reading.
  std::size_t size() const noexcept { return size_; }  ///< number of objects
  /// By slot; number 0 if the slot has no present object.
  std::span<const FrameObject> rows() const noexcept { return rows_.span(); }
  const geometry::ShapeView& shapes() const noexcept { return view_; }
  /// Whether the shape was registered then, and not removed.
  bool has_shape(ShapeNumber shape) const noexcept { return shape < has_shape_.size() && has_shape_[shape]; }
  /// ObjectSpec::user_data of the object in that slot.
  std::uint64_t user_data(std::uint32_t slot) const noexcept { return user_data_[slot]; }
  void prefetch_user_data(std::uint32_t slot) const noexcept { base::prefetch_for_read(&user_data_[slot]); }
  /// The objects where they stand. May throw std::bad_alloc.
  const FramePart& standing() const;
  /// The same objects on their way to `next`, which is the frame after this one. May throw std::bad_alloc.
  const SweptFrames& moving_to(const RecordedFrame& next) const;
  /// The objects of some frames up to this one, which is the last of a block; the last of `frames` is the one after it.
  /// If the first call had fewer frames, the result has only these. May throw std::bad_alloc.
  const SweptFrames& swept(std::span<const std::shared_ptr<const RecordedFrame>> frames) const;

  // Readers pin the frame; on any thread.
  void pin() const noexcept { readers_.fetch_add(1, std::memory_order_relaxed); }
  void unpin() const noexcept { readers_.fetch_sub(1, std::memory_order_release); }
  /// Whether a reader has pinned the frame. If not, what readers did happened before the result.
  bool is_pinned() const noexcept { return readers_.load(std::memory_order_acquire) != 0; }

 private:
  std::shared_ptr<const geometry::ShapeTable> shapes_;
  std::shared_ptr<LastOrder> order_;
  geometry::ShapeView view_;
  std::vector<bool> has_shape_;  ///< by shape number
  std::uint64_t number_ = none;
  std::size_t size_ = 0;
  base::FlatList<FrameObject> rows_;  ///< by slot; number 0 if the slot has no present object
  base::FlatList<RowBounds> bounds_;  ///< by slot, or empty
  std::optional<BoxConverter> box_of_;
  base::FlatList<std::uint64_t> user_data_;
  std::vector<std::uint8_t> sources_;
  mutable std::vector<std::uint8_t> changed_;  ///< by slot: 1 if it was set since standing_ was built
  LazyIndex<FramePart> standing_;
  LazyIndex<SweptFrames> moving_;
  std::unique_ptr<BlockIndex> block_;
  mutable std::atomic<std::uint32_t> readers_{0};
};

}  // namespace ringfence::queries
