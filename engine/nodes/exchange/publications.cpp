#include "nodes/exchange/publications.hpp"

namespace ringfence::nodes {

void note_cell_range(Published& own, std::uint64_t frame) noexcept {
  own.any[frame & 1] = !own.publication->states(frame).empty();
  if (!own.any[frame & 1]) {
    return;
  }
  const link::CellRange cell_range = own.publication->cell_range(frame);
  for (std::size_t axis = 0; axis < 3; ++axis) {
    own.cell_range[frame & 1].lower[axis] = static_cast<std::uint16_t>(cell_range.lower[axis]);
    own.cell_range[frame & 1].upper[axis] = static_cast<std::uint16_t>(cell_range.upper[axis]);
  }
}

}  // namespace ringfence::nodes
