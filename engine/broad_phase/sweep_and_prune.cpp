#include "broad_phase/sweep_and_prune.hpp"

#include <algorithm>
#include <vector>

namespace ringfence::broad_phase {

struct SweepAndPrune::Implementation {
  std::vector<std::uint32_t> order;
  std::vector<geometry::CandidatePair> pairs;
};

SweepAndPrune::SweepAndPrune(std::size_t objects, std::size_t pairs)
    : implementation_(std::make_unique<Implementation>()) {
  implementation_->order.reserve(objects);
  implementation_->pairs.reserve(pairs);
}
SweepAndPrune::~SweepAndPrune() = default;
SweepAndPrune::SweepAndPrune(SweepAndPrune&&) noexcept = default;
SweepAndPrune& SweepAndPrune::operator=(SweepAndPrune&&) noexcept = default;

std::span<const geometry::CandidatePair> SweepAndPrune::find(std::span<const geometry::Bounds> bounds,
                                                             std::span<const std::uint8_t> present,
                                                             std::span<const std::uint8_t> /*resting*/) {
  auto& order = implementation_->order;
  auto& pairs = implementation_->pairs;
  order.clear();
  pairs.clear();
  for (std::uint32_t i = 0; i < bounds.size(); ++i)
    if (present[i] != 0) order.push_back(i);
  std::sort(order.begin(), order.end(),
            [&](std::uint32_t p, std::uint32_t q) { return bounds[p].lower[0] < bounds[q].lower[0]; });
  for (std::size_t i = 0; i < order.size(); ++i)
    for (std::size_t j = i + 1; j < order.size(); ++j) {
      if (bounds[order[j]].lower[0] > bounds[order[i]].upper[0]) break;
      if (geometry::touch(bounds[order[i]], bounds[order[j]])) pairs.push_back({order[i], order[j]});
    }
  return pairs;
}

}  // namespace ringfence::broad_phase
