#include "facade/queries/query_target.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <new>

namespace ringfence::facade {

QueryTarget find_target(const PinnedFrames* frames, const QueryFrame& wanted) noexcept try {
  if (frames == nullptr) return {Status::out_of_order};
  if (!wanted) return {Status::ok, &frames->last(), &frames->last().standing()};
  PinnedFrames::Moment moment;
  if (const Status status = frames->find(*wanted, moment); status != Status::ok) return {status};
  const queries::SweptFrames* swept = frames->swept(moment.frame->number());
  if (swept == nullptr && moment.next != nullptr) swept = &moment.frame->moving_to(*moment.next);
  if (swept == nullptr) return {Status::ok, moment.frame, &moment.frame->standing()};
  return {Status::ok, moment.frame, nullptr, swept, swept->time(moment.frame->number(), moment.fraction)};
} catch (const std::bad_alloc&) {
  return {Status::out_of_memory};
}

// Queries without a frame, and those whose frame is not a number, come last.
void FrameOrder::add(const QueryFrame& frame) {
  const double last = std::numeric_limits<double>::infinity();
  order_.push_back({frame && !std::isnan(*frame) ? *frame : last, static_cast<std::uint32_t>(order_.size())});
}

void FrameOrder::sort_entries() {
  std::sort(order_.begin(), order_.end(), [](const Entry& p, const Entry& q) {
    return p.frame < q.frame || (p.frame == q.frame && p.query < q.query);
  });
}

}  // namespace ringfence::facade
