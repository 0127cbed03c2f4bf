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
  set_table(bisection.split(nodes, std::span<const double>{}));
}

void RegionMap::set_table(std::span<const std::uint32_t> table) {
  MapTables& tables = tables_.own();
  tables.owners.assign(table.begin(), table.end());
  table_ = tables.owners;
  find_uniform_boxes(tables.uniform_boxes);
  uniform_boxes_ = tables.uniform_boxes;
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
void RegionMap::find_uniform_boxes(std::vector<std::uint8_t>& uniform_boxes) const {
  const auto cells = static_cast<std::uint32_t>(grid_.cells());
  uniform_boxes.resize(cells);
  for (std::uint32_t cell = 0; cell < cells; ++cell) {
    uniform_boxes[cell] = is_cut(table_[cell]) ? 0 : 1;
  }
  for (std::size_t axis = 0, shift = 0; axis < 3; shift += grid_.log2[axis++]) {
    const std::uint32_t next = std::uint32_t{1} << shift;
    const std::uint32_t last = grid_.along(axis) - 1;
    const unsigned without_axis = 1u << axis;  // number of bits for the boxes that do not span this axis
    const unsigned known = (1u << without_axis) - 1;
    for (std::uint32_t cell = 0; cell < cells; ++cell) {
      if ((cell >> shift & last) != last && table_[cell] == table_[cell + next]) {
        const unsigned joined = uniform_boxes[cell] & uniform_boxes[cell + next] & known;
        uniform_boxes[cell] = static_cast<std::uint8_t>(uniform_boxes[cell] | joined << without_axis);
      }
    }
  }
}

Coverage RegionMap::coverage_of_many(const geometry::Bounds& bounds, NodeNumber node) const noexcept {
  // Most bounds that are not in a uniform box are on one side of each cut of one cell.
  const CellBox box = grid_.cells_of(bounds);
  if (box.single()) {
    const std::uint32_t entry = part_around(table_[grid_.index(box.lower[0], box.lower[1], box.lower[2])], bounds);
    if (!is_cut(entry)) {
      return entry == node ? Coverage::all : Coverage::none;
    }
  }
  bool some = false;
  bool all = true;
  visit_owners(bounds, [&](NodeNumber owner) {
    some |= owner == node;
    all &= owner == node;
    return !some || all;
  });
  return !some ? Coverage::none : all ? Coverage::all : Coverage::part;
}

std::uint32_t RegionMap::part_around(std::uint32_t entry, const geometry::Bounds& bounds) const noexcept {
  while (is_cut(entry)) {
    const std::size_t axis = axis_of(entry);
    const std::uint32_t* const cut = cut_of(entry);
    const bool above = bounds.lower[axis] >= cut[0];
    if (!above && bounds.upper[axis] >= cut[0]) {
      return entry;
    }
    entry = cut[above ? 2 : 1];
  }
  return entry;
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
  set_table(table);
  nodes_ = nodes;
  epoch_ = epoch;
}

}  // namespace ringfence::regions
