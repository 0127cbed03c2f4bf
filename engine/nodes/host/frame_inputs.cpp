#include "nodes/host/frame_inputs.hpp"

#include <algorithm>
#include <utility>

namespace ringfence::nodes {

void FrameInputs::find_objects(const base::NumberIndex& hosted) {
  for (Found& found : inputs_) {
    found.hosted = hosted.find(found.input.number);
  }
  std::erase_if(inputs_, [](const Found& found) { return found.hosted == base::NumberIndex::none; });
  // Not std::stable_sort, which allocates.
  std::sort(inputs_.begin(), inputs_.end(),
            [](const Found& p, const Found& q) { return std::pair(p.hosted, p.turn) < std::pair(q.hosted, q.turn); });
  std::size_t kept = 0;
  for (std::size_t i = 0; i < inputs_.size(); ++i) {
    const bool last = i + 1 == inputs_.size() || inputs_[i + 1].hosted != inputs_[i].hosted;
    if (last) {
      inputs_[kept++] = inputs_[i];
    }
  }
  inputs_.resize(kept);
}

void FrameInputs::set(std::size_t first, std::span<MotionInput> batch) const noexcept {
  const auto begin = std::lower_bound(inputs_.begin(), inputs_.end(), first,
                                      [](const Found& found, std::size_t index) { return found.hosted < index; });
  for (auto found = begin; found != inputs_.end() && found->hosted < first + batch.size(); ++found) {
    batch[found->hosted - first].input = std::span(found->input.bytes).first(found->input.size);
  }
}

}  // namespace ringfence::nodes
