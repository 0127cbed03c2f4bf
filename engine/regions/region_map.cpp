#include "regions/region_map.hpp"

#include <cassert>
#include <cmath>
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

struct Block {
  std::uint32_t lower[3];
  std::uint32_t upper[3];  // excluded
  std::size_t cells() const { return std::size_t{upper[0] - lower[0]} * (upper[1] - lower[1]) * (upper[2] - lower[2]); }
};

class Bisection {
 public:
  Bisection(const CellGrid& grid, std::span<const double> weights) : grid_(grid), weights_(weights) {
    owners_.resize(grid.cells());
  }

  void split(const Block& block, std::uint32_t first, std::uint32_t nodes) {
    if (nodes == 1) {
      for_each_cell(
          block, [&](std::uint32_t cell, std::uint32_t) { owners_[cell] = first; }, 0);
      return;
    }
    std::uint32_t left = nodes / 2;
    const std::size_t axis = longest_axis(block);
    Block low = block;
    Block high = block;
    low.upper[axis] = high.lower[axis] = cut(block, axis, left, nodes);
    split(low, first, left);
    split(high, first + left, nodes - left);
  }

  std::vector<NodeNumber> take() { return std::move(owners_); }

 private:
  template <class Visit>
  void for_each_cell(const Block& block, Visit visit, std::size_t axis) const {
    for (std::uint32_t z = block.lower[2]; z < block.upper[2]; ++z) {
      for (std::uint32_t y = block.lower[1]; y < block.upper[1]; ++y) {
        for (std::uint32_t x = block.lower[0]; x < block.upper[0]; ++x) {
          const std::uint32_t at[3] = {x, y, z};
          visit(grid_.index(x, y, z), at[axis]);
        }
      }
    }
  }

  static std::size_t longest_axis(const Block& block) {
    std::size_t longest = 0;
    for (std::size_t axis = 1; axis < 3; ++axis) {
      if (block.upper[axis] - block.lower[axis] > block.upper[longest] - block.lower[longest]) {
        longest = axis;
      }
    }
    return longest;
  }

  // Where the weight below comes nearest to its share, leaving each side at least as many cells as nodes.
  // Changes `left` where whole layers could not hold the shares.
  std::uint32_t cut(const Block& block, std::size_t axis, std::uint32_t& left, std::uint32_t nodes) {
    const std::uint32_t layers = block.upper[axis] - block.lower[axis];
    slices_.assign(layers, 0.0);
    for_each_cell(
        block,
        [&](std::uint32_t cell, std::uint32_t at) {
          slices_[at - block.lower[axis]] += weights_.empty() ? 1.0 : weights_[cell];
        },
        axis);
    const std::size_t a_layer = block.cells() / layers;
    auto fewest = static_cast<std::uint32_t>((left + a_layer - 1) / a_layer);
    auto most = layers - static_cast<std::uint32_t>((nodes - left + a_layer - 1) / a_layer);
    if (fewest > most) {
      fewest = most = layers / 2;
      left = static_cast<std::uint32_t>(std::min<std::size_t>(fewest * a_layer, nodes - 1));
    }
    const double total = std::accumulate(slices_.begin(), slices_.end(), 0.0);
    const double share = total * left / nodes;
    std::uint32_t best = fewest;
    double best_error = -1;
    double below = 0;
    for (std::uint32_t layer = 1; layer <= most; ++layer) {
      below += slices_[layer - 1];
      // Without any weight the split is by volume.
      const double error = total > 0
                               ? std::abs(below - share)
                               : std::abs(static_cast<double>(layer) - static_cast<double>(layers) * left / nodes);
      if (layer >= fewest && (best_error < 0 || error < best_error)) {
        best_error = error;
        best = layer;
      }
    }
    return block.lower[axis] + best;
  }

  const CellGrid& grid_;
  std::span<const double> weights_;
  std::vector<NodeNumber> owners_;
  std::vector<double> slices_;
};

}  // namespace

std::vector<NodeNumber> bisect(const CellGrid& grid, std::uint32_t nodes, std::span<const double> weights) {
  assert(nodes >= 1 && nodes <= grid.cells());
  Bisection bisection(grid, weights);
  bisection.split({{0, 0, 0}, {grid.along(0), grid.along(1), grid.along(2)}}, 0, nodes);
  return bisection.take();
}

}  // namespace ringfence::regions
