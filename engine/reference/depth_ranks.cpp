#include "reference/depth_ranks.hpp"

#include <algorithm>

namespace ringfence::reference {
namespace {

/// Number of elements of a sorted list that precede `rank`.
template <class Rank>
std::size_t preceding(const std::vector<Rank>& ranks, const Rank& rank) {
  return static_cast<std::size_t>(std::lower_bound(ranks.begin(), ranks.end(), rank) - ranks.begin());
}

}  // namespace

DepthRanks::DepthRanks(std::span<const DepthBounds> pairs, std::size_t limit) : limit_(limit) {
  for (const DepthBounds& pair : pairs) {
    for (const ObjectNumber number : {pair.a, pair.b}) {
      ranks_[number].by_least.emplace_back(-pair.least, pair.a, pair.b);
      ranks_[number].by_most.emplace_back(-pair.most, pair.a, pair.b);
    }
  }
  for (auto& [number, ranks] : ranks_) {
    std::sort(ranks.by_least.begin(), ranks.by_least.end());
    std::sort(ranks.by_most.begin(), ranks.by_most.end());
  }
}

// At its largest depth, and with all others at their least.
bool DepthRanks::may_be_listed(const DepthBounds& pair) const {
  const Rank best(-pair.most, pair.a, pair.b);
  const auto is_possible = [&](ObjectNumber number) { return preceding(ranks_.at(number).by_least, best) < limit_; };
  return is_possible(pair.a) || is_possible(pair.b);
}

// At its least depth, and with all others at their largest. The pair itself precedes its least depth with its largest.
bool DepthRanks::must_be_listed(const DepthBounds& pair) const {
  const Rank worst(-pair.least, pair.a, pair.b);
  const std::size_t itself = pair.most > pair.least ? 1 : 0;
  const auto is_certain = [&](ObjectNumber number) {
    return preceding(ranks_.at(number).by_most, worst) - itself < limit_;
  };
  return is_certain(pair.a) || is_certain(pair.b);
}

}  // namespace ringfence::reference
