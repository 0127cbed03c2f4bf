#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "base/buffer.hpp"
#include "broad_phase/row_layout.hpp"

namespace ringfence::broad_phase {

/// A box as the sweep keeps it: one aligned load a corner.
///
/// `slot` and `guard` ride in the fourth lane of the exact test (slot of one <= guard of the other), which lets a box
/// be removed in place: see `RowGrid::remove`.
struct alignas(32) GridBox {
  std::uint32_t lower[3];
  std::uint32_t slot;  ///< index in the caller's table
  std::uint32_t upper[3];
  std::uint32_t guard;

  static constexpr std::uint32_t present = 0xfffffffe;
};
static_assert(sizeof(GridBox) == 32);

/// Where a sorted position leads: its box in `RowGrid::boxes`, and its cell.
struct GridEntry {
  std::uint32_t box;
  std::uint32_t key;
};

/// The boxes of one size level, sorted by cell.
///
/// `codes[p]` is what the sweep reads: eight bytes with the box's upper corner and negated lower corner in quanta
/// modulo 256, the number of cells it reaches beyond its own in x (byte 7), and which neighbour rows it must look
/// into (byte 3, see `Crossing`). Two boxes of a level can overlap only if the bytewise sum of one code and the other
/// with its halves swapped has no sign bit in its six coordinates.
struct RowGrid {
  RowLayout layout{};
  std::uint32_t staged = 0;           ///< boxes put in
  std::uint32_t count = 0;            ///< boxes sorted so far
  std::uint32_t sorted_buckets = 0;   ///< buckets sorted so far
  base::Buffer<GridBox> boxes;        ///< in chunks by bucket, as they were staged
  base::Buffer<std::uint32_t> keys;   ///< beside `boxes`, until they are sorted
  base::Buffer<std::uint64_t> codes;  ///< by sorted position; followed by a vector's width of anything
  base::Buffer<GridEntry> entries;    ///< by sorted position
  /// Which layers each layer collides with, 32 masks that outlive the sweep; null where all collide: then the layer
  /// columns are not filled.
  const std::uint32_t* layer_masks = nullptr;
  base::Buffer<std::uint8_t> staged_layers;  ///< beside `boxes`, until they are sorted
  base::Buffer<std::uint32_t>
      layer_bits;                        ///< by sorted position, one bit set; followed by a vector's width of anything
  base::Buffer<std::uint32_t> cell_end;  ///< [1 + key] is one past the key's last position, [0] is 0

  static constexpr std::uint32_t chunk = 256;
  base::Buffer<std::uint32_t> next_chunk;   ///< by chunk: the bucket's next
  base::Buffer<std::uint32_t> first_chunk;  ///< by bucket
  base::Buffer<std::uint32_t> cursor;       ///< by bucket: where its next box goes
  std::uint32_t chunks = 0;

  /// Makes room for up to `boxes_expected` boxes under `layout` and empties the grid.
  void open(const RowLayout& rows, std::size_t boxes_expected, const std::uint32_t* masks);

  /// Gives the bucket whose chunk is full another one; returns where it starts.
  std::uint32_t add_chunk(std::uint32_t full_chunk) noexcept {
    next_chunk[full_chunk] = chunks;
    return chunks++ * chunk;
  }

  /// Positions below this may be swept: they and all that they can meet are sorted.
  std::uint32_t sweepable() const noexcept {
    if (sorted_buckets == layout.buckets) return count;
    // A box looks no further than to the end of the slab after its own.
    const std::uint32_t slab_bits = layout.x_bits + layout.y_bits;
    const std::uint32_t slabs = (sorted_buckets << layout.bucket_shift) >> slab_bits;
    return slabs < 2 ? 0 : cell_end[(slabs - 1) << slab_bits];
  }

  /// Whether a box is within the level's limit, so that its code can be compared with the codes here.
  bool contains(const GridBox& box) const noexcept {
    return (box.upper[0] - box.lower[0] <= layout.limit[0]) & (box.upper[1] - box.lower[1] <= layout.limit[1]) &
           (box.upper[2] - box.lower[2] <= layout.limit[2]);
  }

  /// What it costs, about and in nanoseconds, to ask this grid for all pairs of the boxes of `asker`, judged by a few.
  /// Precondition: both are sorted.
  double estimated_query_cost(const RowGrid& source) const noexcept;

  /// Takes the box at a sorted position out: from then on it overlaps nothing.
  void remove(std::uint32_t position) noexcept {
    GridBox& box = boxes[entries[position].box];
    box.slot = 0xffffffff;
    box.guard = 0;
  }
};

/// Bits of a code's byte 3: what lies beyond the box's own row.
enum NeighbourFlags : std::uint32_t {
  next_row = 1,     ///< the box reaches into the next row
  next_slab = 2,    ///< and into the next slab
  previous_row = 4  ///< it starts so near to its row's start that boxes from the row before may reach it
};

}  // namespace ringfence::broad_phase
