#include "queries/recorded_frame.hpp"

#include <algorithm>
#include <array>
#include <utility>

namespace ringfence::queries {

void RecordedFrame::begin(std::size_t slots, bool has_groups) {
  is_same_ = std::exchange(number_, none) != none && slots == slots_;
  size_before_ = size_;
  standing_.discard();
  moving_.discard();
  if (block_ != nullptr) block_->discard();
  view_ = shapes_->view();
  has_shape_.resize(shapes_->size());
  for (ShapeNumber shape = 0; shape < has_shape_.size(); ++shape) has_shape_[shape] = shapes_->has(shape);
  slots_ = slots;
  size_ = 0;
  rows_.resize(slots);
  slot_of_row_.resize(slots);
  jumped_.resize(slots);
  groups_.resize(has_groups ? slots : 0);
}

void RecordedFrame::begin_bounds(const geometry::FixedSpace& space, const Vec3d& origin) {
  bounds_.resize(slots_);
  changed_.resize(slots_);
  if (box_of_ && is_near_origin(*box_of_, origin)) return;
  box_of_.emplace(space, origin);
  standing_frame_ = none;
}

RecordedFrame::NewRows RecordedFrame::add(std::span<const std::uint32_t> slots) noexcept {
  std::uint32_t* const at = slot_of_row_.data() + size_;
  is_same_ = is_same_ && std::equal(slots.begin(), slots.end(), at);
  if (!is_same_) std::copy(slots.begin(), slots.end(), at);
  const auto next = [&](auto& list) { return std::span(list.data() + size_, list.empty() ? 0 : slots.size()); };
  NewRows rows{next(rows_), next(jumped_), next(groups_), next(bounds_), next(changed_)};
  size_ += slots.size();
  return rows;
}

void RecordedFrame::finish(std::uint64_t number) noexcept {
  number_ = number;
  if (is_same_ && size_ == size_before_) return;
  row_of_slot_.discard();
  has_same_rows_ = false;
}

FrameRows RecordedFrame::objects() const {
  const std::vector<std::uint32_t>& row_of = row_of_slot_.get([&](std::vector<std::uint32_t>& rows) {
    rows.resize(slots_);
    if (size_ != slots_) std::fill(rows.begin(), rows.end(), FrameRows::none);
    for (std::uint32_t row = 0; row < size_; ++row) rows[slot_of_row_[row]] = row;
  });
  return {rows(), row_of, size_, groups_.span(), jumped_.span()};
}

const FramePart& RecordedFrame::standing() const {
  return standing_.get([&](FramePart& part) {
    KnownBounds known;
    if (box_of_) known = {bounds_.span().first(size_), &*box_of_, changed_.span().first(size_), {}, has_same_rows_};
    if (standing_frame_ != none && number_ - standing_frame_ <= base::max_stamp_age) {
      known.built = base::stamp_of(standing_frame_);
    }
    standing_frame_ = none;
    part.build(objects(), *shapes_, known, order_->get());
    if (box_of_) standing_frame_ = number_;
    has_same_rows_ = true;
    order_->set(part.share_order());
  });
}

const SweptFrames& RecordedFrame::moving_to(const RecordedFrame& next) const {
  return moving_.get([&](SweptFrames& part) {
    const std::array<FrameRows, 2> frames{objects(), next.objects()};
    part.build(number_, frames, *shapes_);
  });
}

const SweptFrames& RecordedFrame::swept(std::span<const std::shared_ptr<const RecordedFrame>> frames) const {
  return block_->get([&](SweptFrames& part) {
    std::array<FrameRows, SweptFrames::most + 1> rows;
    for (std::size_t i = 0; i < frames.size(); ++i) rows[i] = frames[i]->objects();
    part.build(frames.front()->number(), std::span(rows).first(frames.size()), *shapes_);
  });
}

}  // namespace ringfence::queries
