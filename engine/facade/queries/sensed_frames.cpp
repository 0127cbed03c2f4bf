#include "facade/queries/sensed_frames.hpp"

#include "facade/queries/frame_recorder.hpp"

namespace ringfence::facade {

const queries::RecordedFrame* SensedFrames::prepare(const nodes::ServerRole& server, std::uint64_t frames) {
  if (distance_ == 0 || frames == 0) return nullptr;
  if (frame_ == nullptr) frame_ = std::make_unique<queries::RecordedFrame>(shapes_, order_);
  record_frame(server, frames - 1, true, *frame_);
  // Here, because roles that build it would wait for each other, and for one that is lost.
  (void)frame_->standing();
  return frame_.get();
}

void SensedFrames::finish(bool any_lost) {
  if (any_lost && frame_ != nullptr) abandoned_.push_back(std::move(frame_));
}

}  // namespace ringfence::facade
