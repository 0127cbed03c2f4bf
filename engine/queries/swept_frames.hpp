#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "base/prefetch.hpp"
#include "geometry/shape_table.hpp"
#include "queries/box_tree.hpp"
#include "queries/frame_object.hpp"
#include "queries/interpolate.hpp"

namespace ringfence::queries {

/// When a query sees the objects of SweptFrames.
struct QueryTime {
  std::uint32_t frame = 0;  ///< 0: the first of them
  double fraction = 0;      ///< 0 to 1, of the way of each object to the next frame; see interpolate()
};

/// Consecutive frames in which an object is present with one shape and does not jump.
struct Stay {
  std::uint32_t key;         ///< of the object
  std::uint32_t row;         ///< of the object in all these frames; FrameRows::none if it is not the same
  std::uint8_t first, last;  ///< frames
};

/// Objects of consecutive frames with one index of their swept bounds: a box contains an object in each of the frames,
/// and on its ways from each frame to the next. A Searcher answers queries about any time in them.
///
/// A box is that of a stay. So an object that jumps, is absent for a while or changes its shape has several small
/// boxes, of which at most one counts at any time.
///
/// Threads: build() by one thread; then all const functions by any number of threads. Memory: kept between builds; 36
/// to 44 bytes for each stay, and 100 bytes of the thread that builds. Refers to the rows: a function may be called for
/// a time as long as the frame of that time is there, and for times between two frames as long as both are.
class SweptFrames {
 public:
  /// The largest number of frames.
  static constexpr std::size_t most = 8;

  /// Replaces the contents by the objects of frame `first` and those that follow, at most `most`. The last element of
  /// `frames` is the frame after them, to which their last ways lead. Poses as in narrow_phase::Body. May throw
  /// std::bad_alloc.
  void build(std::uint64_t first, std::span<const FrameRows> frames, const geometry::ShapeTable& shapes);

  /// Whether queries can ask about the frame with that number, and about the time until the next.
  bool covers(std::uint64_t number) const noexcept { return number - first_ < covered_; }
  /// The time `fraction` after a frame that it covers.
  QueryTime time(std::uint64_t number, double fraction) const noexcept {
    return {static_cast<std::uint32_t>(number - first_), fraction};
  }

  /// The boxes, widened by what exact tests allow.
  const BoxTree& tree() const noexcept { return tree_; }
  /// The object of a box, by its position in the order of the tree; null if the box does not count at that time.
  const FrameObject* object(std::uint32_t box, const QueryTime& time) const noexcept {
    const Stay& stay = stays_[box];
    return time.frame >= stay.first && time.frame <= stay.last ? &object_of(time.frame, stay) : nullptr;
  }
  std::uint32_t group(std::uint32_t box, const QueryTime& time) const noexcept {
    return frames_[time.frame].group(row_of(time.frame, stays_[box]));
  }
  /// Prefetches what object() reads of the index; then object() does not wait.
  void prefetch_place(std::uint32_t box) const noexcept { base::prefetch_for_read(&stays_[box]); }
  /// The same for what object() and pose() read of the rows.
  void prefetch_object(std::uint32_t box, const QueryTime& time) const noexcept {
    const FrameObject* const now = object(box, time);
    if (now == nullptr) return;
    base::prefetch_object(*now);
    if (time.fraction != 0 && time.frame != stays_[box].last) {
      base::prefetch_object(object_of(time.frame + 1, stays_[box]));
    }
  }
  /// The pose of its object. Precondition: the box counts at that time.
  Pose pose(std::uint32_t box, const QueryTime& time) const noexcept {
    const Stay& stay = stays_[box];
    const Pose& from = object_of(time.frame, stay).pose;
    return time.fraction == 0 || time.frame == stay.last
               ? from
               : interpolate(from, object_of(time.frame + 1, stay).pose, time.fraction);
  }

 private:
  std::uint32_t row_of(std::size_t frame, const Stay& stay) const noexcept {
    return stay.row != FrameRows::none ? stay.row : frames_[frame].row_of[stay.key];
  }
  const FrameObject& object_of(std::size_t frame, const Stay& stay) const noexcept {
    return frames_[frame].rows[row_of(frame, stay)];
  }

  std::uint64_t first_ = 0;
  std::size_t covered_ = 0;                 ///< number of frames
  std::array<FrameRows, most + 1> frames_;  ///< those, and the next
  std::vector<Stay> stays_;                 ///< in the order of the tree
  BoxTree tree_;
};

}  // namespace ringfence::queries
