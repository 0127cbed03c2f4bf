#include "regions/bisection.hpp"

#include <algorithm>
#include <bit>
#include <cassert>
#include <cmath>

#include "base/radix_pass.hpp"

namespace ringfence::regions {

Leaf leaf_of(const CellGrid& grid, std::uint32_t cell) noexcept {
  return {.bounds = grid.bounds_of(grid.box_of(cell)), .entry = cell};
}

Bisection::Bisection(const CellGrid& grid) : grid_(grid) {
  owners_.reserve(grid.cells());
  sorted_.reserve(grid.cells());
  other_.reserve(grid.cells());
}

std::span<const NodeNumber> Bisection::split(std::uint32_t nodes, std::span<const double> weights) {
  assert(weights.empty() || weights.size() == grid_.cells());
  cells_.resize(grid_.cells());
  for (std::uint32_t cell = 0; cell < cells_.size(); ++cell) {
    cells_[cell] = leaf_of(grid_, cell);
    cells_[cell].weight = weights.empty() ? 1.0 : weights[cell];
  }
  return split(nodes, cells_);
}

std::span<const NodeNumber> Bisection::split(std::uint32_t nodes, std::span<const Leaf> leaves) {
  assert(nodes >= 1 && nodes <= leaves.size());
  leaves_ = leaves;
  owners_.resize(leaves.size());
  sorted_.resize(leaves.size());
  other_.resize(leaves.size());
  for (std::uint32_t leaf = 0; leaf < leaves.size(); ++leaf) {
    sorted_[leaf].leaf = leaf;
  }
  split_range(0, leaves.size(), 0, nodes);
  return owners_;
}

// Assigns the leaves at sorted positions [begin, end) to the nodes `first` to `first` + `nodes` - 1.
void Bisection::split_range(std::size_t begin, std::size_t end, std::uint32_t first, std::uint32_t nodes) {
  if (nodes == 1) {
    for (std::size_t i = begin; i < end; ++i) {
      owners_[sorted_[i].leaf] = first;
    }
    return;
  }
  const std::uint32_t left = nodes / 2;
  sort_along(longest_axis(begin, end), begin, end);
  const std::size_t middle = cut(begin, end, left, nodes);
  split_range(begin, middle, first, left);
  split_range(middle, end, first + left, nodes - left);
}

// Measured in cells, which are nearly cubes.
std::size_t Bisection::longest_axis(std::size_t begin, std::size_t end) const {
  std::size_t longest = 0;
  double longest_side = 0;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    std::uint64_t low = ~std::uint64_t{0};
    std::uint64_t high = 0;
    for (std::size_t i = begin; i < end; ++i) {
      const Leaf& leaf = leaves_[sorted_[i].leaf];
      low = std::min<std::uint64_t>(low, leaf.bounds.lower[axis]);
      high = std::max(high, leaf.bounds.upper[axis] + std::uint64_t{1});
    }
    const double side = std::ldexp(static_cast<double>(high - low), static_cast<int>(grid_.log2[axis]) - 32);
    if (side > longest_side) {
      longest_side = side;
      longest = axis;
    }
  }
  return longest;
}

// Stable: leaves of one layer keep their order, so a cut within a layer is one step, not scattered. The coordinates of
// cells that are not cut differ in a few bits only, so one pass usually sorts them.
void Bisection::sort_along(std::size_t axis, std::size_t begin, std::size_t end) {
  const std::span<SortKey> range = std::span(sorted_).subspan(begin, end - begin);
  std::uint32_t different = 0;
  for (SortKey& key : range) {
    key.at = leaves_[key.leaf].bounds.lower[axis];
    different |= key.at ^ range.front().at;
  }
  const auto low = static_cast<unsigned>(std::countr_zero(different));
  const auto high = static_cast<unsigned>(std::bit_width(different));
  constexpr unsigned digit_bits = 11;
  for (unsigned shift = low; shift < high; shift += digit_bits) {
    const unsigned bits = std::min(digit_bits, high - shift);
    const std::uint32_t mask = (std::uint32_t{1} << bits) - 1;
    base::radix_pass<SortKey>(range, other_.data(), mask + 1,
                              [&](const SortKey& key) { return key.at >> shift & mask; });
    std::copy_n(other_.begin(), range.size(), range.begin());
  }
}

// The position at which the weight before it is nearest to its share. Leaves each side at least as many leaves as
// nodes.
std::size_t Bisection::cut(std::size_t begin, std::size_t end, std::uint32_t left, std::uint32_t nodes) const {
  double total = 0;
  for (std::size_t i = begin; i < end; ++i) {
    total += leaves_[sorted_[i].leaf].weight;
  }
  const bool weighted = total > 0;
  const double share = (weighted ? total : static_cast<double>(end - begin)) * left / nodes;
  double below = 0;
  std::size_t middle = begin;
  const std::size_t last = end - (nodes - left);
  while (middle < last) {
    const double next = weighted ? leaves_[sorted_[middle].leaf].weight : 1.0;
    if (middle >= begin + left && below + 0.5 * next > share) {
      break;
    }
    below += next;
    ++middle;
  }
  return middle;
}

}  // namespace ringfence::regions
