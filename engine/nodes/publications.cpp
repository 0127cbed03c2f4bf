#include "nodes/publications.hpp"

namespace ringfence::nodes {

void note_reach(Published& own, std::uint64_t frame) noexcept {
  own.any[frame & 1] = !own.publication->states(frame).empty();
  if (!own.any[frame & 1]) {
    return;
  }
  const link::CellReach reach = own.publication->reach(frame);
  for (std::size_t axis = 0; axis < 3; ++axis) {
    own.reach[frame & 1].lower[axis] = static_cast<std::uint16_t>(reach.lower[axis]);
    own.reach[frame & 1].upper[axis] = static_cast<std::uint16_t>(reach.upper[axis]);
  }
}

}  // namespace ringfence::nodes
