#pragma once

#include <cstddef>
#include <cstdint>
#include <span>

#include "geometry/bounds.hpp"

namespace ringfence::broad_phase {

/// How one size level of boxes is cut into rows and cells, and how finely their codes are quantised.
///
/// A box belongs to the *cell* of its lower corner: column x, row y, slab z, each the coordinate shifted right by
/// `cell_shift` and wrapped by `cell_mask`. Wrapping makes the grid a torus: its size follows the number of boxes and
/// not the size of the world, and boxes that only share a cell because of it are told apart by their codes or, at
/// last, by the exact test. All steps are powers of two of the fixed point, so that a cell is three shifts.
///
/// Invariants, which the sweep's "each pair once" rests on:
/// - `limit` is below 31 quanta on each axis: a difference of two corners of overlapping boxes fits a byte, and what is
///   two rows away seldom looks near in it;
/// - a row and a slab are at least two limits deep: a box reaches into the next one at most;
/// - an axis has one cell (mask 0: not partitioned) or at least four rows or slabs, or in x at least twice the cells
///   that a box can reach plus two: no two neighbours of a cell are the same cell.
struct RowLayout {
  std::uint32_t limit[4];        ///< largest extent (upper - lower) of a box of this level; [3] unused
  std::uint32_t quantum[4];      ///< shift to the code's quanta; [3] is 0
  std::uint32_t cell_shift[4];   ///< shift to cells; [3] is 0
  std::uint32_t cell_mask[4];    ///< cells on the axis, a power of two, less one; [3] is 0
  std::uint32_t partitioned[4];  ///< all ones where the axis has more than one cell, else zero
  std::uint32_t x_bits, y_bits;  ///< width of the x and y fields of a key
  std::uint32_t cells;           ///< number of keys
  std::uint32_t back;            ///< cells before its own in which a box that overlaps from below may start
  std::uint32_t bucket_shift;    ///< keys are sorted first by key >> bucket_shift, then inside that bucket
  std::uint32_t buckets;
};

/// The cells on one axis in which a box of the level may start that overlaps [lower, upper]: the first, and how many.
struct AxisCells {
  std::uint32_t first, count;
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

/// The rows in which a box may meet boxes of the level, and the cells there.
struct Neighbourhood {
  AxisCells x, y, z;
  Neighbourhood(const RowLayout& rows, const std::uint32_t (&lower)[3], const std::uint32_t (&upper)[3]) noexcept
      : x(rows, 0, lower[0], upper[0]), y(rows, 1, lower[1], upper[1]), z(rows, 2, lower[2], upper[2]) {}

  /// The key of the first cell of a row, counted from the first of the neighbourhood.
  std::uint32_t row_key(const RowLayout& rows, std::uint32_t dy, std::uint32_t dz) const noexcept {
    return ((y.first + dy) & rows.cell_mask[1]) << rows.x_bits | ((z.first + dz) & rows.cell_mask[2])
                                                                     << (rows.x_bits + rows.y_bits);
  }
};

/// What a plan is made of: a sample of the boxes of one level, and how many they stand for.
struct LevelSample {
  std::span<const geometry::Bounds> boxes;  ///< at most a few thousand, spread evenly; at least one
  std::size_t count;                        ///< boxes in the level
  std::uint32_t limit[3];                   ///< the level's largest extents
};

/// The layout of least expected cost for a level. Looks at extents, at the space the sample occupies, and at how
/// crowded it is where it is crowded; a wrong guess costs time, never pairs. `lanes` is the sweep's vector width.
RowLayout plan_rows(const LevelSample& sample, std::size_t lanes);

/// Upper limits of the extents for each size level, smallest first; the last one holds any box.
///
/// Each is about four times larger than the one before, and only those stand that boxes are in. Returns how many of
/// `levels` it wrote. `slots` are the boxes to look at; at least one.
struct SizeLimit {
  std::uint32_t extent[3];
};
constexpr std::size_t max_levels = 8;
std::size_t plan_levels(std::span<const geometry::Bounds> boxes, std::span<const std::uint32_t> slots,
                        std::span<SizeLimit, max_levels> levels);

}  // namespace ringfence::broad_phase
