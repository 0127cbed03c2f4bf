#pragma once

#include <atomic>
#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <utility>
#include <vector>

#include "base/flat_list.hpp"
#include "base/frame_stamp.hpp"
#include "base/prefetch.hpp"
#include "geometry/shape_table.hpp"
#include "queries/frame_part.hpp"
#include "queries/lazy_index.hpp"
#include "queries/swept_frames.hpp"

namespace ringfence::queries {

/// The present objects of one complete frame, as queries read them, with the indexes that its queries have built.
///
/// Indexes: one of the objects where they stand; one of their ways to the next frame, for times between the two; and,
/// if the frame is the last of a block, that of the block. Each is built by the first query that needs it. The first
/// index keeps the boxes of objects that have not changed for the next frame that is recorded here. Rows are in the
/// order in which they are recorded, because to write them in the order of slots takes several times as long; the first
/// query finds out which row a slot has.
///
/// Threads: one thread records, while no reader has pinned the frame; then all const functions by any number of
/// threads, which wait for each other only while an index is built. Memory: kept between frames; 69 to 109 bytes
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
  /// Begins a frame with objects in slots less than `slots`, of which some have groups or none has: number() is none
  /// until finish(). May throw std::bad_alloc; then nothing is left.
  void begin(std::size_t slots, bool has_groups);
  /// After begin(), always or never: the bounds of all rows are set too, so that the index need not compute them.
  /// `space` is that of the world, `origin` a place in the midst of the objects. May throw std::bad_alloc.
  void begin_bounds(const geometry::FixedSpace& space, const Vec3d& origin);
  /// Rows for the caller to fill. All spans have one element for each, but those that are empty.
  struct NewRows {
    std::span<FrameObject> objects;
    std::span<std::uint8_t> jumped;
    std::span<std::uint32_t> groups;  ///< empty without groups
    // Empty without bounds.
    std::span<RowBounds> bounds;
    std::span<base::FrameStamp> changed;  ///< the last frame in which the object has changed
  };
  /// Adds rows for the objects in these slots. All calls after begin() together add at most as many as there are slots.
  NewRows add(std::span<const std::uint32_t> slots) noexcept;
  /// The frame is complete.
  void finish(std::uint64_t number) noexcept;

  /// The index of a block of frames; null in a frame that is not the last of one. It moves from frame to frame, because
  /// few frames need its memory. May only be changed while no reader has pinned the frame.
  using BlockIndex = LazyIndex<SweptFrames>;
  std::unique_ptr<BlockIndex>& block() noexcept { return block_; }

  // Reading.
  std::size_t size() const noexcept { return size_; }  ///< number of objects
  /// Each has an object; in any order.
  std::span<const FrameObject> rows() const noexcept { return rows_.span().first(size_); }
  /// The slot of each of them.
  std::span<const std::uint32_t> slots() const noexcept { return slot_of_row_.span().first(size_); }
  /// ObjectSpec::group of the object of a row.
  std::uint32_t group(std::size_t row) const noexcept { return groups_.empty() ? 0 : groups_[row]; }
  /// The objects by slot. May throw std::bad_alloc.
  FrameRows objects() const;
  const geometry::ShapeView& shapes() const noexcept { return view_; }
  /// Whether the shape was registered then, and not removed.
  bool has_shape(ShapeNumber shape) const noexcept { return shape < has_shape_.size() && has_shape_[shape]; }
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
  std::size_t slots_ = 0, size_ = 0;
  bool is_same_ = false;                ///< the rows so far have the slots of the frame that was recorded here before
  std::size_t size_before_ = 0;         ///< of that frame
  mutable bool has_same_rows_ = false;  ///< all frames since standing_ was built had its rows
  // By row, as NewRows. The first size_ elements count.
  base::FlatList<FrameObject> rows_;
  base::FlatList<std::uint32_t> slot_of_row_;
  base::FlatList<std::uint8_t> jumped_;
  base::FlatList<std::uint32_t> groups_;
  base::FlatList<RowBounds> bounds_;
  base::FlatList<base::FrameStamp> changed_;
  std::optional<BoxConverter> box_of_;  ///< of bounds_
  LazyIndex<std::vector<std::uint32_t>> row_of_slot_;
  LazyIndex<FramePart> standing_;
  mutable std::uint64_t standing_frame_ = none;  ///< that standing_ was built for, with bounds_ and box_of_
  LazyIndex<SweptFrames> moving_;
  std::unique_ptr<BlockIndex> block_;
  mutable std::atomic<std::uint32_t> readers_{0};
};

}  // namespace ringfence::queries
