#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "base/buffer.hpp"
#include "broad_phase/row_layout.hpp"

namespace ringfence::broad_phase {

/// A box in the layout that the sweep reads: one aligned load for each corner.
///
/// `label` and `guard` use the fourth lane of the exact test (label of one <= guard of the other), which so leaves out
/// pairs of two static objects at no cost. It also allows a box to be removed in place, see `RowGrid::remove`.
struct alignas(32) GridBox {
  std::uint32_t lower[3];
  std::uint32_t label;  ///< index in the caller's table; of a static object with `fixed_bit`
  std::uint32_t upper[3];
  std::uint32_t guard;

  static constexpr std::uint32_t fixed_bit = 0x80000000;
  static constexpr std::uint32_t guard_of_fixed = fixed_bit - 1;  ///< at least every label but those of static objects
  static constexpr std::uint32_t guard_of_others = 0xfffffffe;    ///< at least every label
  std::uint32_t slot() const noexcept { return label & ~fixed_bit; }
};
static_assert(sizeof(GridBox) == 32);

/// What a sorted position refers to: the index of its box in `RowGrid::boxes`, and its cell.
struct GridEntry {
  std::uint32_t box;
  std::uint32_t key;
};

/// The boxes of one size level, sorted by cell.
///
/// The sweep reads `codes[p]`: eight bytes with the box's upper corner and negated lower corner in quanta modulo 256,
/// the number of further cells that the box covers in x (byte 7), and the neighbour rows that have to be searched (byte
/// 3, see `NeighbourFlags`). Two boxes of a level can overlap only if the bytewise sum of one code and the other code
/// with its halves swapped has no sign bit in its six coordinates.
struct RowGrid {
  RowLayout layout{};
  std::uint32_t staged = 0;           ///< boxes in the grid, sorted or not
  std::uint32_t count = 0;            ///< boxes sorted so far
  std::uint32_t sorted_buckets = 0;   ///< buckets sorted so far
  base::Buffer<GridBox> boxes;        ///< chunks of each bucket, in staging order
  base::Buffer<std::uint32_t> keys;   ///< parallel to `boxes`; used until the box is sorted
  base::Buffer<std::uint64_t> codes;  ///< by sorted position; followed by padding, which scans read
  base::Buffer<GridEntry> entries;    ///< by sorted position
  /// For each layer, the mask of the layers that it collides with: 32 masks that outlive the sweep. Null where all
  /// layers collide; the layer columns are then not filled.
  const std::uint32_t* layer_masks = nullptr;
  base::Buffer<std::uint8_t> staged_layers;  ///< parallel to `boxes`; used until the box is sorted
  base::Buffer<std::uint32_t> layer_bits;    ///< by sorted position, one bit set; followed by padding, which scans read
  base::Buffer<std::uint32_t> cell_end;      ///< [1 + key] is one past the last position of the key; [0] is 0

  static constexpr std::uint32_t chunk = 512;
  base::Buffer<std::uint32_t> next_chunk;   ///< by chunk: the next chunk of the same bucket
  base::Buffer<std::uint32_t> first_chunk;  ///< by bucket
  base::Buffer<std::uint32_t> cursor;       ///< by bucket: position of its next box
  std::uint32_t chunks = 0;

  /// Empties the grid, sets its layout, and reserves room for `boxes_expected` boxes.
  void open(const RowLayout& rows, std::size_t boxes_expected, const std::uint32_t* masks);

  /// Appends a chunk to the bucket whose chunk is full. Returns the position where the new chunk starts.
  std::uint32_t add_chunk(std::uint32_t full_chunk) noexcept {
    next_chunk[full_chunk] = chunks;
    return chunks++ * chunk;
  }

  /// Positions below this are ready to be swept: they, and all boxes that they can collide with, are sorted.
  std::uint32_t sweepable() const noexcept {
    if (sorted_buckets == layout.buckets) return count;
    // The sweep of a box searches no further than the end of the next slab.
    const std::uint32_t slab_bits = layout.x_bits + layout.y_bits;
    const std::uint32_t slabs = (sorted_buckets << layout.bucket_shift) >> slab_bits;
    return slabs < 2 ? 0 : cell_end[(slabs - 1) << slab_bits];
  }

  /// Whether a box is within the size limit of the level, so that its code can be compared with the codes of the grid.
  bool contains(const GridBox& box) const noexcept {
    return (box.upper[0] - box.lower[0] <= layout.limit[0]) & (box.upper[1] - box.lower[1] <= layout.limit[1]) &
           (box.upper[2] - box.lower[2] <= layout.limit[2]);
  }

  /// Estimates the cost, in nanoseconds, of finding all pairs of this grid with the boxes of `source`, from a sample of
  /// those boxes. Precondition: both grids are sorted.
  double estimated_query_cost(const RowGrid& source) const noexcept;

  /// Removes the box at a sorted position: from now on it overlaps nothing.
  void remove(std::uint32_t position) noexcept {
    GridBox& box = boxes[entries[position].box];
    box.label = 0xffffffff;
    box.guard = 0;
  }
};

/// Bits of byte 3 of a code: the neighbour rows that concern a box.
enum NeighbourFlags : std::uint32_t {
  next_row = 1,     ///< the box reaches into the next row
  next_slab = 2,    ///< the box reaches into the next slab
  previous_row = 4  ///< the box starts so close to the start of its row that boxes of the previous row may reach it
};

}  // namespace ringfence::broad_phase
