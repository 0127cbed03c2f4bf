#include "nodes/fault_point.hpp"

#include <algorithm>
#include <utility>

#include "telemetry/clock.hpp"

namespace ringfence::nodes {

std::uint32_t FaultRelease::release() noexcept {
  const std::lock_guard lock(mutex_);
  ++releases_;
  released_.notify_all();
  return std::exchange(stopped_, 0u);
}

std::uint64_t FaultRelease::releases() const noexcept {
  const std::lock_guard lock(mutex_);
  return releases_;
}

void FaultRelease::stop_thread(std::uint64_t since, std::chrono::nanoseconds stall) noexcept {
  std::unique_lock lock(mutex_);
  const auto is_released = [&] { return releases_ != since; };
  if (is_released()) {
    return;
  }
  ++stopped_;
  if (stall.count() == 0) {
    released_.wait(lock, is_released);
  } else if (!released_.wait_for(lock, stall, is_released)) {
    --stopped_;
  }
}

void FaultPoint::set(const Fault& fault) noexcept {
  fault_ = fault;
  passes_left_ = fault.passes;
  since_ = release_ != nullptr ? release_->releases() : 0;
}

bool FaultPoint::is_due(NodeStage stage, std::uint64_t frame) noexcept {
  if (fault_->stage != stage || fault_->frame != frame) {
    return false;
  }
  if (passes_left_ != 0) {
    --passes_left_;
    return false;
  }
  return true;
}

bool FaultPoint::stop_before(NodeStage stage, std::uint64_t frame) noexcept {
  if (!is_due(stage, frame)) {
    return false;
  }
  const auto stall = static_cast<std::uint64_t>(fault_->stall_ms * 1e6);
  until_ns_ = stall == 0 ? ~std::uint64_t{0} : telemetry::now_ns() + stall;
  fault_.reset();
  return is_stopped(telemetry::now_ns());
}

void FaultPoint::stop_inside(NodeStage stage, std::uint64_t frame) noexcept {
  if (release_ == nullptr || !is_due(stage, frame)) {
    return;
  }
  // At least 1 ns, because 0 means no limit.
  const double stall_ns = fault_->stall_ms == 0 ? 0 : std::max(1.0, fault_->stall_ms * 1e6);
  fault_.reset();
  release_->stop_thread(since_, std::chrono::nanoseconds(static_cast<std::int64_t>(stall_ns)));
}

bool FaultPoint::stop_lasts(std::uint64_t now_ns) noexcept {
  if (now_ns < until_ns_ && (release_ == nullptr || release_->releases() == since_)) {
    return true;
  }
  until_ns_ = 0;
  return false;
}

}  // namespace ringfence::nodes
