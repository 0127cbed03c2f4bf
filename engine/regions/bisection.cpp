#include "regions/bisection.hpp"

#include <algorithm>
#include <cassert>
#include <numeric>

namespace ringfence::regions {

Bisection::Bisection(const CellGrid& grid)
    : grid_(grid), owners_(grid.cells()), cells_(grid.cells()), sorted_(grid.cells()) {
  layer_.reserve(grid.along(0) + grid.along(1) + grid.along(2));
}

std::span<const NodeNumber> Bisection::split(std::uint32_t nodes, std::span<const double> weights) {
  assert(nodes >= 1 && nodes <= grid_.cells());
  assert(weights.empty() || weights.size() == grid_.cells());
  weights_ = weights;
  std::iota(cells_.begin(), cells_.end(), 0u);
  split_range(0, cells_.size(), 0, nodes);
  return owners_;
}

// The cells [begin, end) of the list go to `nodes` nodes from `first` on.
void Bisection::split_range(std::size_t begin, std::size_t end, std::uint32_t first, std::uint32_t nodes) {
  if (nodes == 1) {
    for (std::size_t i = begin; i < end; ++i) {
      owners_[cells_[i]] = first;
    }
    return;
  }
  const std::uint32_t left = nodes / 2;
  sort_along(longest_axis(begin, end), begin, end);
  const std::size_t middle = cut(begin, end, left, nodes);
  split_range(begin, middle, first, left);
  split_range(middle, end, first + left, nodes - left);
}

std::size_t Bisection::longest_axis(std::size_t begin, std::size_t end) const {
  std::size_t longest = 0;
  std::uint32_t most = 0;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    std::uint32_t low = grid_.along(axis);
    std::uint32_t high = 0;
    for (std::size_t i = begin; i < end; ++i) {
      low = std::min(low, coordinate(cells_[i], axis));
      high = std::max(high, coordinate(cells_[i], axis));
    }
    if (high - low + 1 > most) {
      most = high - low + 1;
      longest = axis;
    }
  }
  return longest;
}

// Stable, so that within a layer the cells keep their order and a cut through it is a step, not a scatter.
void Bisection::sort_along(std::size_t axis, std::size_t begin, std::size_t end) {
  layer_.assign(grid_.along(axis) + 1, 0);
  for (std::size_t i = begin; i < end; ++i) {
    ++layer_[coordinate(cells_[i], axis) + 1];
  }
  std::partial_sum(layer_.begin(), layer_.end(), layer_.begin());
  for (std::size_t i = begin; i < end; ++i) {
    sorted_[begin + layer_[coordinate(cells_[i], axis)]++] = cells_[i];
  }
  std::copy(sorted_.begin() + static_cast<std::ptrdiff_t>(begin), sorted_.begin() + static_cast<std::ptrdiff_t>(end),
            cells_.begin() + static_cast<std::ptrdiff_t>(begin));
}

// Where the weight before comes nearest to its share, leaving each side at least as many cells as nodes.
std::size_t Bisection::cut(std::size_t begin, std::size_t end, std::uint32_t left, std::uint32_t nodes) const {
  double total = 0;
  for (std::size_t i = begin; i < end; ++i) {
    total += weight(cells_[i]);
  }
  const bool weighted = total > 0;
  const double share = (weighted ? total : static_cast<double>(end - begin)) * left / nodes;
  double below = 0;
  std::size_t middle = begin;
  const std::size_t last = end - (nodes - left);
  while (middle < last) {
    const double next = weighted ? weight(cells_[middle]) : 1.0;
    if (middle >= begin + left && below + 0.5 * next > share) {
      break;
    }
    below += next;
    ++middle;
  }
  return middle;
}

}  // namespace ringfence::regions
