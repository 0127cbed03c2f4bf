#include "regions/recent_owners.hpp"

#include <algorithm>

namespace ringfence::regions {

void RecentOwners::find(const RegionMap& map, const geometry::Bounds& bounds) {
  const CellGrid& grid = map.grid();
  const CellBox box = grid.cells_of(bounds);
  lower_ = grid.bounds_of({{box.lower[0], box.lower[1], box.lower[2]}, {box.lower[0], box.lower[1], box.lower[2]}});
  upper_ = grid.bounds_of({{box.upper[0], box.upper[1], box.upper[2]}, {box.upper[0], box.upper[1], box.upper[2]}});
  owners_.clear();
  for (std::uint32_t z = box.lower[2]; z <= box.upper[2]; ++z) {
    for (std::uint32_t y = box.lower[1]; y <= box.upper[1]; ++y) {
      for (std::uint32_t x = box.lower[0]; x <= box.upper[0]; ++x) {
        add_part(map, map.table()[grid.index(x, y, z)], bounds);
      }
    }
  }
}

// Adds the owners of what the bounds cover below the entry, and narrows the ranges at each plane.
void RecentOwners::add_part(const RegionMap& map, std::uint32_t entry, const geometry::Bounds& bounds) {
  if (!RegionMap::is_cut(entry)) {
    if (std::find(owners_.begin(), owners_.end(), entry) == owners_.end()) {
      owners_.push_back(entry);
    }
    return;
  }
  const std::size_t axis = RegionMap::axis_of(entry), words = RegionMap::words_at(entry, map.grid());
  const std::uint32_t plane = map.table()[words];
  if (bounds.lower[axis] >= plane) {
    lower_.lower[axis] = std::max(lower_.lower[axis], plane);
    return add_part(map, map.table()[words + 2], bounds);
  }
  lower_.upper[axis] = std::min(lower_.upper[axis], plane - 1);
  add_part(map, map.table()[words + 1], bounds);
  if (bounds.upper[axis] < plane) {
    upper_.upper[axis] = std::min(upper_.upper[axis], plane - 1);
  } else {
    upper_.lower[axis] = std::max(upper_.lower[axis], plane);
    add_part(map, map.table()[words + 2], bounds);
  }
}

}  // namespace ringfence::regions
