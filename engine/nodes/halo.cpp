#include "nodes/halo.hpp"

namespace ringfence::nodes {

void Halo::reserve(std::size_t objects) {
  records_.reserve(objects);
  told_.reserve(objects);
}

void Halo::start(std::uint64_t frame) {
  frame_ = frame;
  records_.clear();
  told_.clear();
}

}  // namespace ringfence::nodes
