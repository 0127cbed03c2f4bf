#include "regions/refinement.hpp"

#include <algorithm>
#include <cassert>

namespace ringfence::regions {

Refinement::Refinement(const CellGrid& grid) : grid_(grid) {
  cell_weights_.reserve(grid.cells());
  leaves_.reserve(grid.cells());
  table_.reserve(grid.cells());
  joined_.reserve(grid.cells());
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

// Cuts the leaf, and then its parts, as long as they are too heavy and can be cut. Adds the resulting leaves. The
// weights in the leaf are heavy_weights_[begin, end) if its cell is heavy; otherwise that range is empty.
void Refinement::cut(Leaf leaf, std::size_t begin, std::size_t end, const Limits& limits) {
  // The cut crosses the side that is longest relative to `smallest`. It never makes a side shorter than `smallest`.
  std::size_t axis = 3;
  double longest = 0;
  for (std::size_t candidate = 0; candidate < 3; ++candidate) {
    const double side = static_cast<double>(leaf.bounds.upper[candidate]) - leaf.bounds.lower[candidate] + 1;
    const double halves = side / (2.0 * limits.smallest[candidate]);
    if (halves >= 1 && halves > longest) {
      longest = halves;
      axis = candidate;
    }
  }
  const std::size_t cuts = (table_.size() - grid_.cells()) / RegionMap::words_of_cut;
  if (leaf.weight <= limits.heaviest || axis == 3 || cuts >= max_cuts) {
    leaves_.push_back(leaf);
    return;
  }
  const std::uint32_t plane = plane_of(leaf, axis, begin, end, limits.smallest[axis]);
  const auto words = static_cast<std::uint32_t>(table_.size());
  table_.insert(table_.end(), {plane, 0, 0});
  table_[leaf.entry] = RegionMap::cut_entry(axis, static_cast<std::uint32_t>(cuts));
  Leaf below{leaf.bounds, words + 1, 0}, above{leaf.bounds, words + 2, 0};
  below.bounds.upper[axis] = plane - 1;
  above.bounds.lower[axis] = plane;
  const auto first = heavy_weights_.begin() + static_cast<std::ptrdiff_t>(begin);
  const auto last = heavy_weights_.begin() + static_cast<std::ptrdiff_t>(end);
  const auto middle = std::partition(first, last, [&](std::uint64_t key) {
    const Weight& each = weight_of(key);
    const bool lower = each.point[axis] < plane;
    (lower ? below : above).weight += static_cast<double>(each.weight);
    return lower;
  });
  const auto split = static_cast<std::size_t>(middle - heavy_weights_.begin());
  cut(below, begin, split, limits);
  cut(above, split, end, limits);
}

// The middle of the side, or the middle of the gap between weights there, so that fewer objects are on both sides of
// the plane or step to and fro across it. If all weights are on one side, the plane is beside them, with a margin for
// the sizes of objects and for their next steps. A leaf with too much weight has weights.
std::uint32_t Refinement::plane_of(const Leaf& leaf, std::size_t axis, std::size_t begin, std::size_t end,
                                   std::uint32_t margin) const {
  const std::uint64_t lower = leaf.bounds.lower[axis], upper = leaf.bounds.upper[axis];
  const std::uint64_t middle = lower + (upper - lower + 1) / 2;
  std::uint64_t least = upper, most = lower;
  std::uint64_t below = lower, above = upper;  // the weights nearest to the middle
  for (std::size_t i = begin; i < end; ++i) {
    const std::uint64_t at = weight_of(heavy_weights_[i]).point[axis];
    least = std::min(least, at);
    most = std::max(most, at);
    below = at < middle ? std::max(below, at) : below;
    above = at < middle ? above : std::min(above, at);
  }
  const std::uint64_t around = std::max<std::uint64_t>(2 * std::uint64_t{margin}, (most - least) / 8);
  if (least >= middle + around) {
    return static_cast<std::uint32_t>(least - around);
  }
  if (most + around < middle) {
    return static_cast<std::uint32_t>(most + around + 1);
  }
  // Near the middle, and in it for small margins, so that no part is below more than RegionMap::max_depth cuts.
  const std::uint64_t reach = margin < 8 ? 0 : std::min<std::uint64_t>(2 * std::uint64_t{margin}, (upper - lower) / 8);
  return static_cast<std::uint32_t>(std::clamp(below + (above - below + 1) / 2, middle - reach, middle + reach));
}

std::span<const std::uint32_t> Refinement::table(std::span<const NodeNumber> owners) {
  assert(owners.size() == leaves_.size());
  for (std::size_t i = 0; i < leaves_.size(); ++i) {
    table_[leaves_[i].entry] = owners[i];
  }
  joined_.assign(grid_.cells(), 0);
  for (std::size_t cell = 0; cell < grid_.cells(); ++cell) {
    joined_[cell] = joined(table_[cell]);
  }
  return joined_;
}

// The entry, in joined_, of what `entry` is in table_: an owner if all its parts have the same one.
std::uint32_t Refinement::joined(std::uint32_t entry) {
  if (!RegionMap::is_cut(entry)) {
    return entry;
  }
  const std::size_t words = RegionMap::words_at(entry, grid_);
  const std::uint32_t lower = joined(table_[words + 1]);
  const std::uint32_t upper = joined(table_[words + 2]);
  if (lower == upper) {
    return lower;  // an owner, because each cut belongs to one part
  }
  const auto cut = static_cast<std::uint32_t>((joined_.size() - grid_.cells()) / RegionMap::words_of_cut);
  joined_.insert(joined_.end(), {table_[words], lower, upper});
  return RegionMap::cut_entry(RegionMap::axis_of(entry), cut);
}

}  // namespace ringfence::regions
