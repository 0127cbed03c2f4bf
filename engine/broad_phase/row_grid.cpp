#include "broad_phase/row_grid.hpp"

namespace ringfence::broad_phase {

void RowGrid::open(const RowLayout& rows, std::size_t boxes_expected) {
  layout = rows;
  staged = count = sorted_buckets = 0;
  const std::size_t chunks_needed = boxes_expected / chunk + rows.buckets + 1;
  boxes.reserve(chunks_needed * chunk);
  keys.reserve(chunks_needed * chunk);
  next_chunk.reserve(chunks_needed);
  first_chunk.reserve(rows.buckets);
  cursor.reserve(rows.buckets);
  codes.reserve(boxes_expected + 64);
  entries.reserve(boxes_expected);
  cell_end.reserve(std::size_t{rows.cells} + 1);
  cell_end[0] = 0;
  for (chunks = 0; chunks < rows.buckets; ++chunks) {
    first_chunk[chunks] = chunks;
    cursor[chunks] = chunks * chunk;
  }
}

}  // namespace ringfence::broad_phase
