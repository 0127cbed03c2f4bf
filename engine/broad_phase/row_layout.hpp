#pragma once

#include <cstddef>
#include <cstdint>
#include <span>

#include "geometry/bounds.hpp"

namespace ringfence::broad_phase {

/// How the boxes of one size level (see plan_levels) are divided into rows and cells, and how finely their codes (see
/// RowGrid) are quantised.
///
/// A box belongs to the *cell* of its lower corner: column x, row y and slab z, each the coordinate shifted right by
/// `cell_shift` and wrapped by `cell_mask`. Because of the wrapping, the size of the grid depends on the number of
/// boxes and not on the size of the world. Boxes that share a cell only because of the wrapping are separated by their
/// codes or by the exact test. Cells and quanta are powers of two of the fixed-point unit, so a cell is computed by
/// three shifts.
///
/// Invariants, on which the guarantee "each pair once" relies:
/// - `limit` is below 31 quanta on each axis. So the difference between corners of overlapping boxes fits a byte, and
///   the codes of boxes that are two rows apart rarely match.
/// - A row and a slab are at least two limits deep. So a box reaches at most into the next row and the next slab.
/// - An axis that is partitioned (mask not 0) has enough cells that two neighbours of a cell are never the same cell:
///   y and z have at least four rows or slabs, and x has at least twice the number of cells that a box can reach, plus
///   two. An axis that is not partitioned has one cell.
struct RowLayout {
  std::uint32_t limit[4];        ///< largest extent (upper - lower) of a box of this level; [3] unused
  std::uint32_t quantum[4];      ///< shift from coordinates to the quanta of codes; [3] is 0
  std::uint32_t cell_shift[4];   ///< shift from coordinates to cells; [3] is 0
  std::uint32_t cell_mask[4];    ///< number of cells on the axis (a power of two) minus one; [3] is 0
  std::uint32_t partitioned[4];  ///< all bits set if the axis has more than one cell, else zero; [3] is 0
  std::uint32_t x_bits, y_bits;  ///< widths of the x and y fields of a key
  std::uint32_t cells;           ///< number of keys
  std::uint32_t back;            ///< in x: number of cells before a box's own in which an overlapping box may start
  std::uint32_t bucket_shift;    ///< keys are sorted first by key >> bucket_shift, then within the bucket
  std::uint32_t buckets;         ///< number of buckets
};

/// The cells on one axis in which a box of the level that overlaps [lower, upper] may start. A box starts in the cell
/// of its lower corner.
struct AxisCells {
  std::uint32_t first, count;  ///< the first cell, wrapped, and the number of cells
  AxisCells(const RowLayout& rows, std::size_t axis, std::uint32_t lower, std::uint32_t upper) noexcept
      : first(0), count(1) {
    if (rows.partitioned[axis] == 0) return;
    const std::uint32_t shift = rows.cell_shift[axis], mask = rows.cell_mask[axis];
    const std::uint32_t from = (lower < rows.limit[axis] ? 0 : lower - rows.limit[axis]) >> shift;
    const std::uint32_t beyond = (upper >> shift) - from;
    first = from & mask;
    count = (beyond < mask ? beyond : mask) + 1;
  }
};

/// The cells on each axis in which boxes of the level that overlap a given box may start.
struct Neighbourhood {
  AxisCells x, y, z;
  Neighbourhood(const RowLayout& rows, const std::uint32_t (&lower)[3], const std::uint32_t (&upper)[3]) noexcept
      : x(rows, 0, lower[0], upper[0]), y(rows, 1, lower[1], upper[1]), z(rows, 2, lower[2], upper[2]) {}

  /// The key of the cell with column 0 of a row; `dy` and `dz` count from the first row of the neighbourhood.
  std::uint32_t row_key(const RowLayout& rows, std::uint32_t dy, std::uint32_t dz) const noexcept {
    return ((y.first + dy) & rows.cell_mask[1]) << rows.x_bits | ((z.first + dz) & rows.cell_mask[2])
                                                                     << (rows.x_bits + rows.y_bits);
  }
};

/// The input of plan_rows(): a sample of the boxes of one level, and the number of boxes that it represents.
struct LevelSample {
  std::span<const geometry::Bounds> boxes;  ///< one to a few thousand, taken at equal distances from the list of boxes
  std::size_t count;                        ///< number of boxes in the level
  std::uint32_t limit[3];                   ///< the largest extents of a box of the level
};

/// Returns the layout with the least expected cost for a level. Considers the extents of the boxes, the space that the
/// sample occupies, and the density around the boxes. A wrong estimate costs time, but no pair is missed. `lanes` is
/// Kernels::lanes.
RowLayout plan_rows(const LevelSample& sample, std::size_t lanes);

/// The largest extents of the boxes of one size level.
struct SizeLimit {
  std::uint32_t extent[3];
};
constexpr std::size_t max_levels = 8;
/// Plans the size levels of the boxes with the indices `slots` (at least one). Writes the limits of the levels to
/// `levels`, smallest first, and returns the number of levels. The limits grow by a factor of about four from one level
/// to the next. The last level has no limit; of the others, those without boxes are left out.
std::size_t plan_levels(std::span<const geometry::Bounds> boxes, std::span<const std::uint32_t> slots,
                        std::span<SizeLimit, max_levels> levels);

}  // namespace ringfence::broad_phase
