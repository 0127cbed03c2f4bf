#include "broad_phase/row_grid.hpp"

namespace ringfence::broad_phase {

void RowGrid::open(const RowLayout& rows, std::size_t boxes_expected, const std::uint32_t* masks) {
  layout = rows;
  layer_masks = masks;
  staged = count = sorted_buckets = 0;
  const std::size_t chunks_needed = boxes_expected / chunk + rows.buckets + 1;
  boxes.reserve(chunks_needed * chunk);
  keys.reserve(chunks_needed * chunk);
  next_chunk.reserve(chunks_needed);
  first_chunk.reserve(rows.buckets);
  cursor.reserve(rows.buckets);
  codes.reserve(boxes_expected + 64);
  entries.reserve(boxes_expected);
  if (masks != nullptr) {
    staged_layers.reserve(chunks_needed * chunk);
    layer_bits.reserve(boxes_expected + 64);
  }
  cell_end.reserve(std::size_t{rows.cells} + 1);
  cell_end[0] = 0;
  for (chunks = 0; chunks < rows.buckets; ++chunks) {
    first_chunk[chunks] = chunks;
    cursor[chunks] = chunks * chunk;
  }
}

double RowGrid::estimated_query_cost(const RowGrid& source) const noexcept {
  constexpr std::uint32_t most_asked = 16, most_rows = 256;
  const std::uint32_t stride = source.count / most_asked + 1;
  double cost = 0;
  std::uint32_t asked = 0;
  for (std::uint32_t p = stride / 2; p < source.count; p += stride, ++asked) {
    const GridBox& box = source.boxes[source.entries[p].box];
    if (contains(box)) {
      cost += 20;
      continue;
    }
    const Neighbourhood near(layout, box.lower, box.upper);
    const std::uint32_t all_rows = near.y.count * near.z.count;
    const std::uint32_t skip = (all_rows + most_rows - 1) / most_rows;
    std::uint32_t rows = 0;
    double found = 0;
    for (std::uint32_t row = 0; row < all_rows; row += skip, ++rows) {
      const std::uint32_t first = near.row_key(layout, row % near.y.count, row / near.y.count);
      const std::uint32_t boxes_in_row = cell_end[first + layout.cell_mask[0] + 1] - cell_end[first];
      found += boxes_in_row * double(near.x.count) / (double(layout.cell_mask[0]) + 1);
    }
    cost += all_rows * (3 + 4 * found / rows);
  }
  return asked == 0 ? 0 : cost * source.count / asked;
}

}  // namespace ringfence::broad_phase
