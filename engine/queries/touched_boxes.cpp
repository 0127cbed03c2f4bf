#include "queries/touched_boxes.hpp"

namespace ringfence::queries {

void TouchedBoxes::reserve(std::size_t boxes) {
  for (auto& list : groups_) list.resize(boxes / tree_width + 1 + stream_slack);
  ends_.resize(boxes + tree_width + stream_slack);
  room_ = boxes;
}

}  // namespace ringfence::queries
