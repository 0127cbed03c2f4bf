#include "regions/region_map.hpp"

#include <cassert>
#include <string>

#include "regions/bisection.hpp"
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
  Bisection bisection(grid);
  const auto owners = bisection.split(nodes, {});
  owners_.assign(owners.begin(), owners.end());
}

Cover RegionMap::cover(const CellBox& box, NodeNumber node) const noexcept {
  if (nodes_ == 1) {
    return node == 0 ? Cover::all : Cover::none;
  }
  bool some = false;
  bool all = true;
  for (std::uint32_t z = box.lower[2]; z <= box.upper[2]; ++z) {
    for (std::uint32_t y = box.lower[1]; y <= box.upper[1]; ++y) {
      for (std::uint32_t x = box.lower[0]; x <= box.upper[0]; ++x) {
        const bool own = owners_[grid_.index(x, y, z)] == node;
        some |= own;
        all &= own;
        if (some && !all) {
          return Cover::part;
        }
      }
    }
  }
  return all ? Cover::all : Cover::none;
}

void RegionMap::assign(std::span<const NodeNumber> owners, std::uint32_t nodes, std::uint32_t epoch) {
  assert(owners.size() == grid_.cells());
  owners_.assign(owners.begin(), owners.end());
  nodes_ = nodes;
  epoch_ = epoch;
}

}  // namespace ringfence::regions
