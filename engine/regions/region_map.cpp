#include "regions/region_map.hpp"

#include <algorithm>
#include <cassert>
#include <numeric>
#include <string>
#include <utility>

#include "ringfence/error.hpp"

namespace ringfence::regions {

CellGrid CellGrid::choose(const double extents[3], std::size_t cells) {
  constexpr std::uint32_t most = 10;
  CellGrid grid;
  double side[3] = {extents[0], extents[1], extents[2]};
  while (grid.cells() < cells) {
    std::size_t longest = 3;
    for (std::size_t axis = 0; axis < 3; ++axis) {
      if (grid.log2[axis] < most && (longest == 3 || side[axis] > side[longest])) {
        longest = axis;
      }
    }
    if (longest == 3) {
      break;
    }
    ++grid.log2[longest];
    side[longest] *= 0.5;
  }
  return grid;
}

RegionMap::RegionMap(CellGrid grid, std::uint32_t nodes) : grid_(grid), nodes_(nodes) {
  if (nodes == 0 || nodes > grid.cells()) {
    throw Error("regions: " + std::to_string(nodes) + " nodes cannot share " + std::to_string(grid.cells()) +
                " cells; raise WorldConfig::cells_log2 or lower WorldConfig::nodes");
  }
  owners_ = bisect(grid, nodes, {});
}

bool RegionMap::covers(const CellBox& box, NodeNumber node) const noexcept {
  for (std::uint32_t z = box.lower[2]; z <= box.upper[2]; ++z) {
    for (std::uint32_t y = box.lower[1]; y <= box.upper[1]; ++y) {
      for (std::uint32_t x = box.lower[0]; x <= box.upper[0]; ++x) {
        if (owners_[grid_.index(x, y, z)] == node) {
          return true;
        }
      }
    }
  }
  return false;
}

void RegionMap::assign(std::span<const NodeNumber> owners, std::uint32_t nodes, std::uint32_t epoch) {
  assert(owners.size() == grid_.cells());
  owners_.assign(owners.begin(), owners.end());
  nodes_ = nodes;
  epoch_ = epoch;
}

namespace {

class Bisection {
 public:
  Bisection(const CellGrid& grid, std::span<const double> weights)
      : grid_(grid), weights_(weights), owners_(grid.cells()), cells_(grid.cells()), sorted_(grid.cells()) {
    std::iota(cells_.begin(), cells_.end(), 0u);
  }

  // The cells [begin, end) of the list go to `nodes` nodes from `first` on.
  void split(std::size_t begin, std::size_t end, std::uint32_t first, std::uint32_t nodes) {
    if (nodes == 1) {
      for (std::size_t i = begin; i < end; ++i) {
        owners_[cells_[i]] = first;
      }
      return;
    }
    const std::uint32_t left = nodes / 2;
    sort_along(longest_axis(begin, end), begin, end);
    const std::size_t middle = cut(begin, end, left, nodes);
    split(begin, middle, first, left);
    split(middle, end, first + left, nodes - left);
  }

  std::vector<NodeNumber> take() { return std::move(owners_); }

 private:
  std::uint32_t coordinate(std::uint32_t cell, std::size_t axis) const { return grid_.box_of(cell).lower[axis]; }
  double weight(std::uint32_t cell) const { return weights_.empty() ? 1.0 : weights_[cell]; }

  std::size_t longest_axis(std::size_t begin, std::size_t end) const {
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
  void sort_along(std::size_t axis, std::size_t begin, std::size_t end) {
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
  std::size_t cut(std::size_t begin, std::size_t end, std::uint32_t left, std::uint32_t nodes) const {
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

  const CellGrid& grid_;
  std::span<const double> weights_;
  std::vector<NodeNumber> owners_;
  std::vector<std::uint32_t> cells_;
  std::vector<std::uint32_t> sorted_;
  std::vector<std::size_t> layer_;
};

}  // namespace

std::vector<NodeNumber> bisect(const CellGrid& grid, std::uint32_t nodes, std::span<const double> weights) {
  assert(nodes >= 1 && nodes <= grid.cells());
  assert(weights.empty() || weights.size() == grid.cells());
  Bisection bisection(grid, weights);
  bisection.split(0, grid.cells(), 0, nodes);
  return bisection.take();
}

}  // namespace ringfence::regions
