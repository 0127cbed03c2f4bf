#include "nodes/publications.hpp"

namespace ringfence::nodes {

void note_reach(Published& own, const regions::CellGrid& grid, std::uint64_t frame) noexcept {
  const auto cells = own.publication->cells(frame);
  own.any[frame & 1] = !cells.empty();
  if (cells.empty()) {
    return;
  }
  regions::CellBox reach = grid.box_of(cells.front());
  reach.upper[2] = grid.box_of(cells.back()).upper[2];  // z is what cells are ordered by first
  for (const std::uint32_t cell : cells) {
    const regions::CellBox at = grid.box_of(cell);
    for (std::size_t axis = 0; axis < 2; ++axis) {
      reach.lower[axis] = std::min(reach.lower[axis], at.lower[axis]);
      reach.upper[axis] = std::max(reach.upper[axis], at.upper[axis]);
    }
  }
  own.reach[frame & 1] = reach;
}

}  // namespace ringfence::nodes
