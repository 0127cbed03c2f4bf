#include "regions/region_map.hpp"

#include <algorithm>
#include <cassert>
#include <string>

#include "regions/bisection.hpp"
#include "ringfence/error.hpp"

namespace ringfence::regions {

CellGrid CellGrid::choose(const double extents[3], std::size_t cells) {
  constexpr std::uint32_t max_log2 = 10;
  CellGrid grid;
  double side[3] = {extents[0], extents[1], extents[2]};
  while (grid.cells() < cells) {
    std::size_t longest = 3;
    for (std::size_t axis = 0; axis < 3; ++axis) {
      if (grid.log2[axis] < max_log2 && (longest == 3 || side[axis] > side[longest])) {
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
                " cells; raise WorldConfig::tuning.cells_log2 or lower WorldConfig::nodes");
  }
  Bisection bisection(grid);
  const auto owners = bisection.split(nodes, std::span<const double>{});
  table_.assign(owners.begin(), owners.end());
  find_uniform_boxes();
  find_sole_owner();
}

void RegionMap::find_sole_owner() noexcept {
  sole_owner_ = many_owners;
  for (std::size_t word = 0; word < table_.size(); ++word) {
    if (is_plane(word, grid_) || is_cut(table_[word])) {
      continue;
    }
    if (sole_owner_ != many_owners && table_[word] != sole_owner_) {
      sole_owner_ = many_owners;
      return;
    }
    sole_owner_ = table_[word];
  }
}

// A box that spans a set of axes is two neighbouring boxes that span all of these axes but the last.
void RegionMap::find_uniform_boxes() {
  const auto cells = static_cast<std::uint32_t>(grid_.cells());
  uniform_boxes_.resize(cells);
  for (std::uint32_t cell = 0; cell < cells; ++cell) {
    uniform_boxes_[cell] = is_cut(table_[cell]) ? 0 : 1;
  }
  for (std::size_t axis = 0, shift = 0; axis < 3; shift += grid_.log2[axis++]) {
    const std::uint32_t next = std::uint32_t{1} << shift;
    const std::uint32_t last = grid_.along(axis) - 1;
    const unsigned without_axis = 1u << axis;  // number of bits for the boxes that do not span this axis
    const unsigned known = (1u << without_axis) - 1;
    for (std::uint32_t cell = 0; cell < cells; ++cell) {
      if ((cell >> shift & last) != last && table_[cell] == table_[cell + next]) {
        const unsigned joined = uniform_boxes_[cell] & uniform_boxes_[cell + next] & known;
        uniform_boxes_[cell] = static_cast<std::uint8_t>(uniform_boxes_[cell] | joined << without_axis);
      }
    }
  }
}

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

geometry::Bounds RegionMap::interior(NodeNumber node) const {
  CellBox box;
  if (!find_middle(table_, grid_, node, box)) {
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
        blocked[side] |= box.upper[axis] + 1u == grid_.along(axis);
        layer.lower[axis] = layer.upper[axis] = static_cast<std::uint16_t>(box.upper[axis] + 1);
      }
      blocked[side] = blocked[side] || !owns(table_, grid_, layer, node);
      if (!blocked[side]) {
        (side % 2 == 0 ? box.lower : box.upper)[axis] = layer.lower[axis];
        grows = true;
      }
    }
  }
  return grid_.bounds_of(box);
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

}  // namespace

geometry::Bounds RegionMap::densest_part(NodeNumber node) const {
  DeepPart densest;
  for (std::uint32_t cell = 0; has_cuts() && cell < grid_.cells(); ++cell) {
    find_densest(*this, table_[cell], {grid_.bounds_of(grid_.box_of(cell)), 0}, node, densest);
  }
  return densest.bounds;
}

Coverage RegionMap::coverage_of_many(const geometry::Bounds& bounds, NodeNumber node) const noexcept {
  bool some = false;
  bool all = true;
  visit_owners(bounds, [&](NodeNumber owner) {
    some |= owner == node;
    all &= owner == node;
    return !some || all;
  });
  return !some ? Coverage::none : all ? Coverage::all : Coverage::part;
}

NodeNumber RegionMap::owner_below(std::uint32_t entry, const std::uint32_t point[3]) const noexcept {
  while (is_cut(entry)) {
    const std::uint32_t* const cut = cut_of(entry);
    entry = cut[point[axis_of(entry)] < cut[0] ? 1 : 2];
  }
  return entry;
}

bool RegionMap::has_cuts(const CellBox& box) const noexcept {
  if (!has_cuts()) {
    return false;
  }
  for (std::uint32_t z = box.lower[2]; z <= box.upper[2]; ++z) {
    for (std::uint32_t y = box.lower[1]; y <= box.upper[1]; ++y) {
      for (std::uint32_t x = box.lower[0]; x <= box.upper[0]; ++x) {
        if (is_cut(table_[grid_.index(x, y, z)])) {
          return true;
        }
      }
    }
  }
  return false;
}

bool RegionMap::is_table(std::span<const std::uint32_t> table, const CellGrid& grid, std::uint32_t nodes) {
  const std::size_t cells = grid.cells();
  if (table.size() < cells || table.size() > max_words(grid) || (table.size() - cells) % words_of_cut != 0) {
    return false;
  }
  const std::size_t cuts = (table.size() - cells) / words_of_cut;
  struct OpenPart {
    std::uint32_t entry;
    geometry::Bounds bounds;
    std::size_t depth;
  };
  // Terminates, because every cut adds two parts and is visited once.
  std::vector<bool> visited(cuts, false);
  std::vector<OpenPart> open;
  for (std::uint32_t cell = 0; cell < cells; ++cell) {
    open.push_back({table[cell], grid.bounds_of(grid.box_of(cell)), 0});
    while (!open.empty()) {
      const OpenPart part = open.back();
      open.pop_back();
      if (!is_cut(part.entry)) {
        if (part.entry >= nodes) {
          return false;
        }
        continue;
      }
      const std::size_t axis = axis_of(part.entry);
      const std::size_t cut = part.entry & cut_bits;
      if (axis > 2 || cut >= cuts || visited[cut] || part.depth == max_depth) {
        return false;
      }
      visited[cut] = true;
      const std::uint32_t* const words = &table[cells + words_of_cut * cut];
      const std::uint32_t plane = words[0];
      if (plane <= part.bounds.lower[axis] || plane > part.bounds.upper[axis]) {
        return false;
      }
      open.push_back({words[1], part.bounds, part.depth + 1});
      open.back().bounds.upper[axis] = plane - 1;
      open.push_back({words[2], part.bounds, part.depth + 1});
      open.back().bounds.lower[axis] = plane;
    }
  }
  return true;
}

void RegionMap::assign(std::span<const std::uint32_t> table, std::uint32_t nodes, std::uint32_t epoch) {
  assert(table.size() >= grid_.cells() && (table.size() - grid_.cells()) % words_of_cut == 0);
  table_.assign(table.begin(), table.end());
  find_uniform_boxes();
  find_sole_owner();
  nodes_ = nodes;
  epoch_ = epoch;
}

}  // namespace ringfence::regions
