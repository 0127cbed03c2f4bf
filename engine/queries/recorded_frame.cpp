#include "queries/recorded_frame.hpp"

#include <algorithm>
#include <array>
#include <utility>

#include "base/frame_stamp.hpp"

namespace ringfence::queries {

std::uint64_t RecordedFrame::begin(std::size_t slots, std::uint64_t number) {
  std::uint64_t kept = std::exchange(number_, none);
  standing_.discard();
  moving_.discard();
  if (block_ != nullptr) block_->discard();
  view_ = shapes_->view();
  has_shape_.resize(shapes_->size());
  for (ShapeNumber shape = 0; shape < has_shape_.size(); ++shape) has_shape_[shape] = shapes_->has(shape);
  if (kept == none || kept > number || number - kept > base::max_stamp_age || slots < rows_.size()) {
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

const FramePart& RecordedFrame::standing() const {
  return standing_.get([&](FramePart& part) {
    part.build(rows_.span(), size_, *shapes_, {bounds_.span(), box_of_ ? &*box_of_ : nullptr, changed_}, order_->get());
    std::fill(changed_.begin(), changed_.end(), std::uint8_t{0});
    order_->set(part.share_order());
  });
}

const SweptFrames& RecordedFrame::moving_to(const RecordedFrame& next) const {
  return moving_.get([&](SweptFrames& part) {
    const std::array<SweptFrames::Rows, 2> frames{rows(), next.rows()};
    part.build(number_, frames, *shapes_);
  });
}

const SweptFrames& RecordedFrame::swept(std::span<const std::shared_ptr<const RecordedFrame>> frames) const {
  return block_->get([&](SweptFrames& part) {
    std::array<SweptFrames::Rows, SweptFrames::most + 1> rows;
    for (std::size_t i = 0; i < frames.size(); ++i) rows[i] = frames[i]->rows();
    part.build(frames.front()->number(), std::span(rows).first(frames.size()), *shapes_);
  });
}

}  // namespace ringfence::queries
