#include "queries/recorded_frame.hpp"

#include <array>

namespace ringfence::queries {

void RecordedFrame::begin(std::size_t slots) {
  number_ = none;
  standing_.discard();
  moving_.discard();
  if (block_ != nullptr) block_->discard();
  view_ = shapes_->view();
  has_shape_.resize(shapes_->size());
  for (ShapeNumber shape = 0; shape < has_shape_.size(); ++shape) has_shape_[shape] = shapes_->has(shape);
  rows_.resize(slots);
  user_data_.resize(slots);
  bounds_.clear();
}

void RecordedFrame::begin_bounds(const geometry::FixedSpace& space, const Vec3d& origin) {
  bounds_.resize(rows_.size());
  box_of_.emplace(space, origin);
}

void RecordedFrame::finish(std::uint64_t number, std::size_t objects) noexcept {
  size_ = objects;
  number_ = number;
}

const FramePart& RecordedFrame::standing() const {
  return standing_.get([&](FramePart& part) {
    part.build(rows_.span(), size_, *shapes_, {bounds_.span(), box_of_ ? &*box_of_ : nullptr}, order_->get());
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
