#include "regions/owned_boxes.hpp"

#include <algorithm>
#include <array>
#include <span>
#include <vector>

namespace ringfence::regions {

namespace {

/// Whether `node` owns all cells of the box and none is cut.
bool owns(std::span<const std::uint32_t> table, const CellGrid& grid, const CellBox& box, NodeNumber node) {
  for (std::uint32_t z = box.lower[2]; z <= box.upper[2]; ++z) {
    for (std::uint32_t y = box.lower[1]; y <= box.upper[1]; ++y) {
      const std::uint32_t* const row = &table[grid.index(box.lower[0], y, z)];
      if (!std::all_of(row, row + (box.upper[0] - box.lower[0] + 1), [&](std::uint32_t at) { return at == node; })) {
        return false;
      }
    }
  }
  return true;
}

/// Sets `middle` to an uncut cell that `node` owns: the middle cell of the box around all such cells if it is one of
/// them, else any. Returns false if there is none.
bool find_middle(std::span<const std::uint32_t> table, const CellGrid& grid, NodeNumber node, CellBox& middle) {
  CellBox reach;
  bool any = false;
  for (std::uint32_t cell = 0; cell < grid.cells(); ++cell) {
    if (table[cell] != node) {
      continue;
    }
    middle = grid.box_of(cell);
    for (std::size_t axis = 0; axis < 3; ++axis) {
      reach.lower[axis] = any ? std::min(reach.lower[axis], middle.lower[axis]) : middle.lower[axis];
      reach.upper[axis] = any ? std::max(reach.upper[axis], middle.upper[axis]) : middle.upper[axis];
    }
    any = true;
  }
  if (!any) {
    return false;
  }
  const std::uint32_t cell = grid.index((std::uint32_t{reach.lower[0]} + reach.upper[0]) / 2,
                                        (std::uint32_t{reach.lower[1]} + reach.upper[1]) / 2,
                                        (std::uint32_t{reach.lower[2]} + reach.upper[2]) / 2);
  middle = table[cell] == node ? grid.box_of(cell) : middle;
  return true;
}

}  // namespace

geometry::Bounds interior(const RegionMap& map, NodeNumber node) {
  const CellGrid& grid = map.grid();
  CellBox box;
  if (!find_middle(map.table(), grid, node, box)) {
    return {{1, 1, 1}, {0, 0, 0}};
  }
  // A side that cannot move by a layer stays blocked when the box grows elsewhere.
  bool blocked[6] = {};
  for (bool grows = true; grows;) {
    grows = false;
    for (std::size_t side = 0; side < 6; ++side) {
      const std::size_t axis = side / 2;
      CellBox layer = box;
      if (side % 2 == 0) {
        blocked[side] |= box.lower[axis] == 0;
        layer.lower[axis] = layer.upper[axis] = static_cast<std::uint16_t>(box.lower[axis] - 1);
      } else {
        blocked[side] |= box.upper[axis] + 1u == grid.along(axis);
        layer.lower[axis] = layer.upper[axis] = static_cast<std::uint16_t>(box.upper[axis] + 1);
      }
      blocked[side] = blocked[side] || !owns(map.table(), grid, layer, node);
      if (!blocked[side]) {
        (side % 2 == 0 ? box.lower : box.upper)[axis] = layer.lower[axis];
        grows = true;
      }
    }
  }
  return grid.bounds_of(box);
}

namespace {

/// A part of a cell, and the number of cuts above it.
struct DeepPart {
  geometry::Bounds bounds{{1, 1, 1}, {0, 0, 0}};
  std::size_t cuts = 0;

  double volume() const noexcept {
    double product = 1;
    for (std::size_t axis = 0; axis < 3; ++axis) {
      product *= static_cast<double>(bounds.upper[axis]) - bounds.lower[axis] + 1;
    }
    return product;
  }
};

void find_densest(const RegionMap& map, std::uint32_t entry, const DeepPart& part, NodeNumber node, DeepPart& densest) {
  if (RegionMap::is_cut(entry)) {
    const std::size_t axis = RegionMap::axis_of(entry), words = RegionMap::words_at(entry, map.grid());
    DeepPart lower{part.bounds, part.cuts + 1}, upper = lower;
    lower.bounds.upper[axis] = map.table()[words] - 1;
    upper.bounds.lower[axis] = map.table()[words];
    find_densest(map, map.table()[words + 1], lower, node, densest);
    find_densest(map, map.table()[words + 2], upper, node, densest);
  } else if (entry == node && (part.cuts > densest.cuts ||
                               (part.cuts > 0 && part.cuts == densest.cuts && part.volume() > densest.volume()))) {
    densest = part;
  }
}

/// The planes of the cuts of a cell, and of its faces, by axis. Each is the lowest coordinate of what is above it.
using Planes = std::array<std::vector<std::uint64_t>, 3>;

void collect_planes(const RegionMap& map, std::uint32_t entry, Planes& planes) {
  if (RegionMap::is_cut(entry)) {
    const std::size_t words = RegionMap::words_at(entry, map.grid());
    planes[RegionMap::axis_of(entry)].push_back(map.table()[words]);
    collect_planes(map, map.table()[words + 1], planes);
    collect_planes(map, map.table()[words + 2], planes);
  }
}

Planes planes_of(const RegionMap& map, std::uint32_t cell) {
  Planes planes;
  collect_planes(map, map.table()[cell], planes);
  const geometry::Bounds faces = map.grid().bounds_of(map.grid().box_of(cell));
  for (std::size_t axis = 0; axis < 3; ++axis) {
    planes[axis].push_back(faces.lower[axis]);
    planes[axis].push_back(faces.upper[axis] + std::uint64_t{1});
    std::sort(planes[axis].begin(), planes[axis].end());
    planes[axis].erase(std::unique(planes[axis].begin(), planes[axis].end()), planes[axis].end());
  }
  return planes;
}

/// Moves a side of the box outwards to the next plane, if `node` owns the layer that this adds.
bool grow(const RegionMap& map, std::span<const std::uint64_t> planes, std::size_t axis, bool upwards, NodeNumber node,
          geometry::Bounds& box) {
  const std::uint64_t side = upwards ? box.upper[axis] + std::uint64_t{1} : box.lower[axis];
  const auto at = std::lower_bound(planes.begin(), planes.end(), side);
  if (at == (upwards ? planes.end() - 1 : planes.begin())) {
    return false;
  }
  geometry::Bounds layer = box;
  layer.lower[axis] = static_cast<std::uint32_t>(upwards ? side : *(at - 1));
  layer.upper[axis] = static_cast<std::uint32_t>((upwards ? *(at + 1) : side) - 1);
  if (map.coverage(layer, node) != Coverage::all) {
    return false;
  }
  box.lower[axis] = std::min(box.lower[axis], layer.lower[axis]);
  box.upper[axis] = std::max(box.upper[axis], layer.upper[axis]);
  return true;
}

}  // namespace

geometry::Bounds densest_box(const RegionMap& map, NodeNumber node) {
  const CellGrid& grid = map.grid();
  DeepPart densest;
  for (std::uint32_t cell = 0; map.has_cuts() && cell < grid.cells(); ++cell) {
    find_densest(map, map.table()[cell], {grid.bounds_of(grid.box_of(cell)), 0}, node, densest);
  }
  geometry::Bounds box = densest.bounds;
  if (densest.cuts == 0) {
    return box;
  }
  const Planes planes = planes_of(map, grid.cell_of(box.lower));
  for (bool grows = true; grows;) {
    grows = false;
    for (std::size_t side = 0; side < 6; ++side) {
      grows |= grow(map, planes[side / 2], side / 2, side % 2 == 1, node, box);
    }
  }
  return box;
}

}  // namespace ringfence::regions
