#include "regions/refinement.hpp"

#include <algorithm>
#include <cassert>

namespace ringfence::regions {

Refinement::Refinement(const CellGrid& grid) : grid_(grid) {
  cell_weights_.reserve(grid.cells());
  leaves_.reserve(grid.cells());
  table_.reserve(grid.cells());
}

void Refinement::refine(std::span<const Weight> weights, double heaviest, const std::uint32_t (&smallest)[3]) {
  weights_ = weights;
  cell_weights_.assign(grid_.cells(), 0.0);
  for (const Weight& each : weights) {
    cell_weights_[grid_.cell_of(each.point)] += static_cast<double>(each.weight);
  }
  picked_.clear();
  for (std::uint32_t i = 0; i < weights.size(); ++i) {
    const std::uint32_t cell = grid_.cell_of(weights[i].point);
    if (cell_weights_[cell] > heaviest) {
      picked_.push_back(std::uint64_t{cell} << 32 | i);
    }
  }
  std::sort(picked_.begin(), picked_.end());
  leaves_.clear();
  table_.assign(grid_.cells(), 0);
  std::size_t begin = 0;
  for (std::uint32_t cell = 0; cell < grid_.cells(); ++cell) {
    std::size_t end = begin;
    while (end < picked_.size() && picked_[end] >> 32 == cell) {
      ++end;
    }
    Leaf leaf = leaf_of(grid_, cell);
    leaf.weight = cell_weights_[cell];
    cut(leaf, begin, end, {heaviest, smallest});
    begin = end;
  }
}

// What weighs in the leaf is at [begin, end) of the picked, if it is heavy.
void Refinement::cut(Leaf leaf, std::size_t begin, std::size_t end, const Limits& limits) {
  // The side that is longest for what stands there; one more cut may not make it shorter than that.
  std::size_t axis = 3;
  double longest = 0;
  for (std::size_t each = 0; each < 3; ++each) {
    const double halves = static_cast<double>(std::uint64_t{1} << leaf.bits[each]) / (2.0 * limits.smallest[each]);
    if (leaf.bits[each] > 0 && halves >= 1 && halves > longest) {
      longest = halves;
      axis = each;
    }
  }
  const std::size_t cuts = (table_.size() - grid_.cells()) / 2;
  if (leaf.weight <= limits.heaviest || axis == 3 || cuts >= most_cuts) {
    leaves_.push_back(leaf);
    return;
  }
  const auto pair = static_cast<std::uint32_t>(table_.size());
  table_.resize(table_.size() + 2, 0);
  table_[leaf.entry] = RegionMap::cut_entry(axis, static_cast<std::uint32_t>(cuts));
  --leaf.bits[axis];
  const std::uint32_t plane = leaf.lower[axis] + (std::uint32_t{1} << leaf.bits[axis]);
  Leaf below = leaf;
  Leaf above = leaf;
  below.entry = pair;
  above.entry = pair + 1;
  above.lower[axis] = plane;
  below.weight = 0;
  above.weight = 0;
  const auto first = picked_.begin() + static_cast<std::ptrdiff_t>(begin);
  const auto last = picked_.begin() + static_cast<std::ptrdiff_t>(end);
  const auto middle = std::partition(first, last, [&](std::uint64_t picked) {
    const Weight& each = weights_[static_cast<std::uint32_t>(picked)];
    const bool lower = each.point[axis] < plane;
    (lower ? below : above).weight += static_cast<double>(each.weight);
    return lower;
  });
  const auto split = static_cast<std::size_t>(middle - picked_.begin());
  cut(below, begin, split, limits);
  cut(above, split, end, limits);
}

std::span<const std::uint32_t> Refinement::table(std::span<const NodeNumber> owners) {
  assert(owners.size() == leaves_.size());
  for (std::size_t i = 0; i < leaves_.size(); ++i) {
    table_[leaves_[i].entry] = owners[i];
  }
  return table_;
}

}  // namespace ringfence::regions
