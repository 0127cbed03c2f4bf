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
/// - `limit` is at most 62 quanta on each axis: then a difference of two corners of overlapping boxes fits a byte;
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
