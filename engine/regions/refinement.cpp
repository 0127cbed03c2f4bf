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
  heavy_weights_.clear();
  for (std::uint32_t i = 0; i < weights.size(); ++i) {
    const std::uint32_t cell = grid_.cell_of(weights[i].point);
    if (cell_weights_[cell] > heaviest) {
      heavy_weights_.push_back(std::uint64_t{cell} << 32 | i);
    }
  }
  std::sort(heavy_weights_.begin(), heavy_weights_.end());
  leaves_.clear();
  table_.assign(grid_.cells(), 0);
  std::size_t begin = 0;
  for (std::uint32_t cell = 0; cell < grid_.cells(); ++cell) {
    std::size_t end = begin;
    while (end < heavy_weights_.size() && heavy_weights_[end] >> 32 == cell) {
      ++end;
    }
    Leaf leaf = leaf_of(grid_, cell);
    leaf.weight = cell_weights_[cell];
    cut(leaf, begin, end, {heaviest, smallest});
    begin = end;
  }
}

// Cuts the leaf, and then its halves, as long as they are too heavy and can be cut. Adds the resulting leaves. The
// weights in the leaf are heavy_weights_[begin, end) if its cell is heavy; otherwise that range is empty.
void Refinement::cut(Leaf leaf, std::size_t begin, std::size_t end, const Limits& limits) {
  // The cut crosses the side that is longest relative to `smallest`. It never makes a side shorter than `smallest`.
  std::size_t axis = 3;
  double longest = 0;
  for (std::size_t candidate = 0; candidate < 3; ++candidate) {
    const double halves =
        static_cast<double>(std::uint64_t{1} << leaf.bits[candidate]) / (2.0 * limits.smallest[candidate]);
    if (leaf.bits[candidate] > 0 && halves >= 1 && halves > longest) {
      longest = halves;
      axis = candidate;
    }
  }
  const std::size_t cuts = (table_.size() - grid_.cells()) / 2;
  if (leaf.weight <= limits.heaviest || axis == 3 || cuts >= max_cuts) {
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
  const auto first = heavy_weights_.begin() + static_cast<std::ptrdiff_t>(begin);
  const auto last = heavy_weights_.begin() + static_cast<std::ptrdiff_t>(end);
  const auto middle = std::partition(first, last, [&](std::uint64_t key) {
    const Weight& each = weights_[static_cast<std::uint32_t>(key)];
    const bool lower = each.point[axis] < plane;
    (lower ? below : above).weight += static_cast<double>(each.weight);
    return lower;
  });
  const auto split = static_cast<std::size_t>(middle - heavy_weights_.begin());
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
