#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "base/numbers.hpp"
#include "geometry/bounds.hpp"
#include "regions/shared_tables.hpp"

namespace ringfence::regions {

/// A box of cells. Both corners are included.
struct CellBox {
  std::uint16_t lower[3] = {};
  std::uint16_t upper[3] = {};
  constexpr bool operator==(const CellBox&) const noexcept = default;
  /// Whether the box consists of one cell.
  constexpr bool single() const noexcept {
    return lower[0] == upper[0] && lower[1] == upper[1] && lower[2] == upper[2];
  }
  /// Whether all of `other` lies within this box.
  constexpr bool contains(const CellBox& other) const noexcept {
    return lower[0] <= other.lower[0] && other.upper[0] <= upper[0] && lower[1] <= other.lower[1] &&
           other.upper[1] <= upper[1] && lower[2] <= other.lower[2] && other.upper[2] <= upper[2];
  }
};

/// A grid of cells: the number of cells on each axis, as log2.
struct CellGrid {
  std::uint32_t log2[3] = {0, 0, 0};

  std::size_t cells() const noexcept { return std::size_t{1} << (log2[0] + log2[1] + log2[2]); }
  /// Number of cells on an axis.
  std::uint32_t along(std::size_t axis) const noexcept { return std::uint32_t{1} << log2[axis]; }

  /// The cell coordinate of a fixed-point coordinate. Cells are half-open: a cell contains its lower faces. The
  /// outermost cells reach to infinity, because fixed-point coordinates saturate.
  std::uint32_t coordinate(std::uint32_t fixed, std::size_t axis) const noexcept {
    return static_cast<std::uint32_t>(std::uint64_t{fixed} >> (32 - log2[axis]));
  }
  /// Cell number: x varies fastest, so the cells of a row are consecutive in lists sorted by cell.
  std::uint32_t index(std::uint32_t x, std::uint32_t y, std::uint32_t z) const noexcept {
    return x | y << log2[0] | z << (log2[0] + log2[1]);
  }
  /// Number of the cell that contains a fixed-point position.
  std::uint32_t cell_of(const std::uint32_t point[3]) const noexcept {
    return index(coordinate(point[0], 0), coordinate(point[1], 1), coordinate(point[2], 2));
  }
  /// The box that consists of one cell.
  CellBox box_of(std::uint32_t cell) const noexcept {
    const auto x = static_cast<std::uint16_t>(cell & (along(0) - 1));
    const auto y = static_cast<std::uint16_t>(cell >> log2[0] & (along(1) - 1));
    const auto z = static_cast<std::uint16_t>(cell >> (log2[0] + log2[1]));
    return {{x, y, z}, {x, y, z}};
  }
  /// The box of all cells.
  CellBox all() const noexcept {
    CellBox box;
    for (std::size_t axis = 0; axis < 3; ++axis) {
      box.upper[axis] = static_cast<std::uint16_t>(along(axis) - 1);
    }
    return box;
  }
  /// The cells that the bounds overlap. Bounds that touch a cell's lower face overlap it; its upper face belongs to the
  /// next cell.
  CellBox cells_of(const geometry::Bounds& bounds) const noexcept {
    CellBox box;
    for (std::size_t axis = 0; axis < 3; ++axis) {
      box.lower[axis] = static_cast<std::uint16_t>(coordinate(bounds.lower[axis], axis));
      box.upper[axis] = static_cast<std::uint16_t>(coordinate(bounds.upper[axis], axis));
    }
    return box;
  }

  /// The bounds of a box of cells.
  geometry::Bounds bounds_of(const CellBox& box) const noexcept {
    geometry::Bounds bounds;
    for (std::size_t axis = 0; axis < 3; ++axis) {
      const std::uint32_t bits = 32 - log2[axis];
      bounds.lower[axis] = static_cast<std::uint32_t>(std::uint64_t{box.lower[axis]} << bits);
      bounds.upper[axis] = static_cast<std::uint32_t>(((box.upper[axis] + std::uint64_t{1}) << bits) - 1);
    }
    return bounds;
  }

  /// A grid of about `cells` nearly cubic cells for a world with these extents in metres; at most 2^10 cells on an
  /// axis.
  static CellGrid choose(const double extents[3], std::size_t cells);
};

/// How much of the space within given bounds a node owns.
enum class Coverage : std::uint8_t { none, part, all };

/// States which CD node owns which cell. The region of a node is the set of its cells and parts of cells: a cell that
/// is too heavy for one node is cut by a plane across an axis, and its two parts again, as often as needed.
///
/// The table has one entry for each cell: its owner, or cut_entry() if the cell is cut. Then follow three words for
/// each cut: the plane, which is the lowest fixed-point coordinate of the upper part, and the entries of the lower and
/// the upper part. An owner is a node's slot, below nodes(); some slots may own nothing.
///
/// Ownership is a pure function of bounds and this map, so the server and all nodes, on any machine, agree without
/// communication. Threads: immutable except for assign(); each role has its own copy. Memory: 5 bytes a cell and 12 a
/// cut; copies share them until one of them is assigned another table.
class RegionMap {
  static constexpr std::uint32_t is_cut_bit = std::uint32_t{1} << 31;
  static constexpr std::uint32_t cut_bits = 0x1fffffffu;

 public:
  static constexpr std::size_t words_of_cut = 3;
  /// The entry of a cell, or part of a cell, that is cut across `axis` by cut number `cut`.
  static constexpr std::uint32_t cut_entry(std::size_t axis, std::uint32_t cut) noexcept {
    return is_cut_bit | static_cast<std::uint32_t>(axis) << 29 | cut;
  }
  static constexpr bool is_cut(std::uint32_t entry) noexcept { return (entry & is_cut_bit) != 0; }
  /// The axis of a cut, from its entry.
  static constexpr std::size_t axis_of(std::uint32_t entry) noexcept { return entry >> 29 & 3u; }
  /// The first of the words of a cut, from its entry.
  static std::size_t words_at(std::uint32_t entry, const CellGrid& grid) noexcept {
    return grid.cells() + words_of_cut * std::size_t{entry & cut_bits};
  }
  /// Whether a word of a table is the plane of a cut, not an entry.
  static bool is_plane(std::size_t word, const CellGrid& grid) noexcept {
    return word >= grid.cells() && (word - grid.cells()) % words_of_cut == 0;
  }

  /// Divides all cells among `nodes` nodes, in boxes of nearly equal volume. Throws Error unless `nodes` is 1 to the
  /// number of cells.
  RegionMap(CellGrid grid, std::uint32_t nodes);

  const CellGrid& grid() const noexcept { return grid_; }
  /// All owners are below this number.
  std::uint32_t nodes() const noexcept { return nodes_; }
  /// The node that owns all cells; `many_owners` if there is more than one.
  NodeNumber sole_owner() const noexcept { return sole_owner_; }
  static constexpr NodeNumber many_owners = 0xffffffffu;
  /// Serial number of the map; it increases with each change. All contacts of a frame are found under one epoch.
  std::uint32_t epoch() const noexcept { return epoch_; }
  std::span<const std::uint32_t> table() const noexcept { return table_; }
  /// Whether any cell is cut.
  bool has_cuts() const noexcept { return table_.size() > grid_.cells(); }
  /// Whether any cell of the box is cut.
  bool has_cuts(const CellBox& box) const noexcept;

  /// The node whose region contains a fixed-point position. It hosts the objects there.
  NodeNumber owner_at(const std::uint32_t point[3]) const noexcept {
    const std::uint32_t entry = table_[grid_.cell_of(point)];
    return is_cut(entry) ? owner_below(entry, point) : entry;
  }

  /// The node that tests a pair: the one whose region contains the lower corner of the intersection of the two bounds.
  /// Both bounds cover that corner's cell, so the node knows both objects. Precondition: touch(p, q).
  NodeNumber pair_owner(const geometry::Bounds& p, const geometry::Bounds& q) const noexcept {
    const std::uint32_t corner[3] = {std::max(p.lower[0], q.lower[0]), std::max(p.lower[1], q.lower[1]),
                                     std::max(p.lower[2], q.lower[2])};
    return owner_at(corner);
  }

  /// Calls `visit(node)` for the owner of each cell or part of a cell that the bounds cover, at least once for each
  /// owner. Stops when `visit` returns false.
  template <class Visit>
  void visit_owners(const geometry::Bounds& bounds, Visit&& visit) const {
    const CellBox box = grid_.cells_of(bounds);
    if (const std::uint32_t cell = grid_.index(box.lower[0], box.lower[1], box.lower[2]); is_uniform(box, cell)) {
      visit(table_[cell]);
      return;
    }
    for (std::uint32_t z = box.lower[2]; z <= box.upper[2]; ++z) {
      for (std::uint32_t y = box.lower[1]; y <= box.upper[1]; ++y) {
        for (std::uint32_t x = box.lower[0]; x <= box.upper[0]; ++x) {
          const std::uint32_t cell = grid_.index(x, y, z);
          if (!visit_part(table_[cell], bounds, visit)) {
            return;
          }
        }
      }
    }
  }

  /// How much of the space within the bounds `node` owns.
  Coverage coverage(const geometry::Bounds& bounds, NodeNumber node) const noexcept {
    if (sole_owner_ != many_owners) {
      return node == sole_owner_ ? Coverage::all : Coverage::none;
    }
    const CellBox box = grid_.cells_of(bounds);
    if (const std::uint32_t cell = grid_.index(box.lower[0], box.lower[1], box.lower[2]); is_uniform(box, cell)) {
      return table_[cell] == node ? Coverage::all : Coverage::none;
    }
    return coverage_of_many(bounds, node);
  }

  /// Whether `table`, which may come from the network, is a valid table for a map of `grid`: every cell or part of a
  /// cell is owned by a node below `nodes` or cut by a plane through it, every cut belongs to one cell or part, and no
  /// part is below more than `max_depth` cuts, so that a search does not recurse deeper.
  static bool is_table(std::span<const std::uint32_t> table, const CellGrid& grid, std::uint32_t nodes);
  /// Maximum number of cuts of a map.
  static constexpr std::size_t max_cuts = 16384;
  /// Maximum number of cuts above a part. Cuts that each leave at most half of a side make no more.
  static constexpr std::size_t max_depth = 96;
  /// Maximum number of words of a table.
  static std::size_t max_words(const CellGrid& grid) noexcept { return grid.cells() + words_of_cut * max_cuts; }

  /// Replaces the table. Precondition: is_table(table, grid(), nodes).
  void assign(std::span<const std::uint32_t> table, std::uint32_t nodes, std::uint32_t epoch);

 private:
  /// The words of a cut: plane, lower part, upper part.
  const std::uint32_t* cut_of(std::uint32_t entry) const noexcept { return &table_[words_at(entry, grid_)]; }
  /// Whether uniform_boxes_ shows that one node owns all cells of the box whose lowest cell is `cell`. Most bounds are
  /// smaller than a cell, so their boxes span one or two cells on each axis.
  bool is_uniform(const CellBox& box, std::uint32_t cell) const noexcept {
    const auto across = [&](std::size_t axis) { return std::uint32_t{box.upper[axis]} - box.lower[axis]; };
    const std::uint32_t x = across(0), y = across(1), z = across(2);
    return (x | y | z) <= 1 && (uniform_boxes_[cell] >> (x | y << 1 | z << 2) & 1) != 0;
  }
  void set_table(std::span<const std::uint32_t> table);
  void find_uniform_boxes(std::vector<std::uint8_t>& uniform_boxes) const;
  void find_sole_owner() noexcept;
  Coverage coverage_of_many(const geometry::Bounds& bounds, NodeNumber node) const noexcept;
  /// The smallest part below `entry` that contains the bounds: its owner, or the cut that passes through them.
  std::uint32_t part_around(std::uint32_t entry, const geometry::Bounds& bounds) const noexcept;
  NodeNumber owner_below(std::uint32_t entry, const std::uint32_t point[3]) const noexcept;

  template <class Visit>
  bool visit_part(std::uint32_t entry, const geometry::Bounds& bounds, Visit& visit) const {
    while (is_cut(entry)) {
      const std::size_t axis = axis_of(entry);
      const std::uint32_t* const cut = cut_of(entry);
      const std::uint32_t plane = cut[0];
      if (bounds.lower[axis] >= plane) {
        entry = cut[2];
      } else if (bounds.upper[axis] < plane || visit_part(cut[1], bounds, visit)) {
        entry = bounds.upper[axis] < plane ? cut[1] : cut[2];
      } else {
        return false;
      }
    }
    return visit(entry);
  }

  CellGrid grid_;
  std::uint32_t nodes_;
  std::uint32_t epoch_ = 1;
  NodeNumber sole_owner_ = many_owners;
  SharedTables tables_;
  std::span<const std::uint32_t> table_;         ///< in tables_
  std::span<const std::uint8_t> uniform_boxes_;  ///< the same
};

/// Calls `visit(node)` once for each node that owns space which the bounds cover.
///
/// `stamps` belongs to the caller and has one entry for each node. `stamp` is a value that is not in `stamps` yet; it
/// is stored in the entry of each visited node.
template <class Visit>
void for_each_owner(const RegionMap& map, const geometry::Bounds& bounds, std::span<std::uint64_t> stamps,
                    std::uint64_t stamp, Visit visit) {
  map.visit_owners(bounds, [&](NodeNumber node) {
    if (stamps[node] != stamp) {
      stamps[node] = stamp;
      visit(node);
    }
    return true;
  });
}

/// The same for the owners of a box of cells. Precondition: none of them is cut.
template <class Visit>
void for_each_owner(const RegionMap& map, const CellBox& box, std::span<std::uint64_t> stamps, std::uint64_t stamp,
                    Visit visit) {
  const CellGrid& grid = map.grid();
  for (std::uint32_t z = box.lower[2]; z <= box.upper[2]; ++z) {
    for (std::uint32_t y = box.lower[1]; y <= box.upper[1]; ++y) {
      for (std::uint32_t x = box.lower[0]; x <= box.upper[0]; ++x) {
        const NodeNumber node = map.table()[grid.index(x, y, z)];
        if (stamps[node] != stamp) {
          stamps[node] = stamp;
          visit(node);
        }
      }
    }
  }
}

}  // namespace ringfence::regions
