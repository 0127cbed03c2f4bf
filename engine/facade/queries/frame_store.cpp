#include "facade/queries/frame_store.hpp"

#include <algorithm>
#include <cmath>
#include <span>
#include <utility>

#include "facade/queries/frame_recorder.hpp"

namespace ringfence::facade {
namespace {

constexpr std::uint64_t block_frames = queries::SweptFrames::most;

}  // namespace

PinnedFrames::PinnedFrames(Frames frames) : frames_(std::move(frames)) {
  for (const auto& frame : frames_) frame->pin();
}

PinnedFrames::~PinnedFrames() {
  for (const auto& frame : frames_) frame->unpin();
}

Status PinnedFrames::find(double number, Moment& moment) const noexcept {
  const std::uint64_t first = frames_.front()->number(), last = frames_.back()->number();
  if (!(number <= static_cast<double>(last))) return Status::bad_number;
  if (number < static_cast<double>(first)) return Status::frame_expired;
  const double whole = std::floor(number);
  const auto at = static_cast<std::size_t>(static_cast<std::uint64_t>(whole) - first);
  moment.frame = frames_[at].get();
  moment.fraction = number - whole;
  moment.next = moment.fraction == 0 ? nullptr : frames_[at + 1].get();
  return Status::ok;
}

const queries::SweptFrames* PinnedFrames::swept(std::uint64_t number) const {
  const std::uint64_t begin = number - number % block_frames, end = begin + block_frames;
  if (end > last().number()) return nullptr;
  // The first ones may have expired.
  const std::uint64_t first = std::max(begin, this->first().number());
  const std::span frames = std::span(frames_).subspan(first - this->first().number(), end - first + 1);
  const queries::SweptFrames& swept = frames[frames.size() - 2]->swept(frames);
  return swept.covers(number) ? &swept : nullptr;
}

void FrameStore::record(const nodes::ServerRole& server, std::uint64_t number) {
  if (has(number)) return;
  // Without a history only the last frame is kept. A gap ends the history: queries between two frames need both.
  const bool follows = !kept_.empty() && kept_.back()->number() + 1 == number;
  const std::size_t kept = follows ? std::min(kept_.size(), history_) : 0;
  free_.reserve(free_.size() + kept_.size());
  for (std::size_t i = 0; i < kept_.size() - kept; ++i) free_.push_back(std::move(kept_[i]));
  kept_.erase(kept_.begin(), kept_.end() - static_cast<std::ptrdiff_t>(kept));
  kept_.reserve(history_ + 1);
  const std::shared_ptr<queries::RecordedFrame> frame = take_free();
  // Of the frames of a history, few are asked about while they are the last.
  record_frame(server, number, !keeps_history(), *frame);
  if (keeps_history()) move_block(number, *frame);
  kept_.push_back(frame);
}

std::shared_ptr<queries::RecordedFrame> FrameStore::take_free() {
  const auto found = std::find_if(free_.begin(), free_.end(), [](const auto& frame) { return !frame->is_pinned(); });
  if (found == free_.end()) return std::make_shared<queries::RecordedFrame>(shapes_, order_);
  std::shared_ptr<queries::RecordedFrame> frame = std::move(*found);
  free_.erase(found);
  return frame;
}

/// Gives an index of a block to a frame that is the last of one, and takes it from others.
void FrameStore::move_block(std::uint64_t number, queries::RecordedFrame& frame) {
  const bool ends_block = number % block_frames == block_frames - 1;
  std::unique_ptr<queries::RecordedFrame::BlockIndex>& block = frame.block();
  if (ends_block == (block != nullptr)) return;
  if (!ends_block) {
    free_blocks_.push_back(std::move(block));
  } else if (free_blocks_.empty()) {
    block = std::make_unique<queries::RecordedFrame::BlockIndex>();
  } else {
    block = std::move(free_blocks_.back());
    block->discard();
    free_blocks_.pop_back();
  }
}

std::shared_ptr<const PinnedFrames> FrameStore::pin() {
  std::shared_ptr<const PinnedFrames> pinned = pinned_.lock();
  if (pinned == nullptr || &pinned->last() != kept_.back().get()) {
    pinned = std::make_shared<const PinnedFrames>(PinnedFrames::Frames(kept_.begin(), kept_.end()));
    pinned_ = pinned;
  }
  return pinned;
}

std::uint64_t FrameStore::drop_obsolete() {
  if (history_ == 0 && !kept_.empty()) {
    free_.push_back(std::move(kept_.back()));
    kept_.clear();
  }
  std::uint64_t oldest = kept_.empty() ? queries::RecordedFrame::none : kept_.front()->number();
  for (const auto& frame : free_) {
    if (frame->is_pinned()) oldest = std::min(oldest, frame->number());
  }
  return oldest;
}

}  // namespace ringfence::facade
