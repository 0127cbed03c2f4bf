#include "queries/recorded_frame.hpp"

#include <algorithm>
#include <utility>

#include "base/frame_stamp.hpp"

namespace ringfence::queries {

std::uint64_t RecordedFrame::begin(std::size_t slots, std::uint64_t number) {
  std::uint64_t kept = std::exchange(number_, none);
  standing_.built.store(false, std::memory_order_relaxed);
  moving_.built.store(false, std::memory_order_relaxed);
  view_ = shapes_->view();
  has_shape_.resize(shapes_->size());
  for (ShapeNumber shape = 0; shape < has_shape_.size(); ++shape) has_shape_[shape] = shapes_->has(shape);
  if (kept == none || kept > number || number - kept > base::stamps_last || slots < rows_.size()) {
    kept = none;
    sources_.clear();
    changed_.clear();
  }
  rows_.resize(slots);
  user_data_.resize(slots);
  sources_.resize(slots);
  changed_.resize(slots, 1);
  return kept;
}

void RecordedFrame::begin_bounds(const geometry::FixedSpace& space, const Vec3d& origin) {
  bounds_.resize(rows_.size());
  if (box_of_ && is_near_origin(*box_of_, origin)) return;
  box_of_.emplace(space, origin);
  std::fill(changed_.begin(), changed_.end(), std::uint8_t{1});
}

void RecordedFrame::finish(std::uint64_t number, std::size_t objects) noexcept {
  size_ = objects;
  number_ = number;
}

template <class Build>
const FramePart& RecordedFrame::part(LazyPart& lazy, Build build) const {
  if (!lazy.built.load(std::memory_order_acquire)) {
    const std::lock_guard lock(building_);
    if (!lazy.built.load(std::memory_order_relaxed)) {
      build();
      lazy.built.store(true, std::memory_order_release);
    }
  }
  return lazy.part;
}

const FramePart& RecordedFrame::standing() const {
  return part(standing_, [&] {
    standing_.part.build(rows_.span(), size_, {}, *shapes_, {bounds_.span(), box_of_ ? &*box_of_ : nullptr, changed_},
                         order_->get());
    std::fill(changed_.begin(), changed_.end(), std::uint8_t{0});
    order_->set(standing_.part.share_order());
  });
}

const FramePart& RecordedFrame::moving_to(const RecordedFrame& next) const {
  return part(moving_, [&] {
    std::vector<Pose> ends;
    ends.reserve(rows_.size());
    for (const FrameObject& row : rows_.span()) ends.push_back(pose_at_end(row, next));
    moving_.part.build(rows_.span(), size_, ends, *shapes_, {}, order_->get());
  });
}

const Pose& RecordedFrame::pose_at_end(const FrameObject& row, const RecordedFrame& next) noexcept {
  if (row.slot >= next.rows_.size()) return row.pose;
  const FrameObject& then = next.rows_[row.slot];
  const bool moves =
      then.number == row.number && then.generation == row.generation && then.shape == row.shape && then.jumped == 0;
  return moves ? then.pose : row.pose;
}

}  // namespace ringfence::queries
