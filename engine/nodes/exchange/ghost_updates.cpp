#include "nodes/exchange/ghost_updates.hpp"

namespace ringfence::nodes {

void GhostUpdates::reserve(std::size_t objects) {
  records_.reserve(objects);
  entries_.reserve(objects);
}

void GhostUpdates::start(std::uint64_t frame) {
  frame_ = frame;
  records_.clear();
  entries_.clear();
}

}  // namespace ringfence::nodes
