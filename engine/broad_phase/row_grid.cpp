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
  constexpr std::uint32_t max_samples = 16, max_rows = 256;
  const std::uint32_t stride = source.count / max_samples + 1;
  double cost = 0;
  std::uint32_t sampled = 0;
  for (std::uint32_t p = stride / 2; p < source.count; p += stride, ++sampled) {
    const GridBox& box = source.boxes[source.entries[p].box];
    if (contains(box)) {
      cost += 20;
      continue;
    }
    const Neighbourhood cells(layout, box.lower, box.upper);
    const std::uint32_t all_rows = cells.y.count * cells.z.count;
    const std::uint32_t skip = (all_rows + max_rows - 1) / max_rows;
    std::uint32_t rows = 0;
    double found = 0;
    for (std::uint32_t row = 0; row < all_rows; row += skip, ++rows) {
      const std::uint32_t first = cells.row_key(layout, row % cells.y.count, row / cells.y.count);
      const std::uint32_t boxes_in_row = cell_end[first + layout.cell_mask[0] + 1] - cell_end[first];
      found += boxes_in_row * double(cells.x.count) / (double(layout.cell_mask[0]) + 1);
    }
    cost += all_rows * (3 + 4 * found / rows);
  }
  return sampled == 0 ? 0 : cost * source.count / sampled;
}

}  // namespace ringfence::broad_phase
