#include "nodes/halo.hpp"

namespace ringfence::nodes {

void Halo::reserve(std::size_t objects) {
  records_.reserve(objects);
  entries_.reserve(objects);
  told_.reserve(objects);
}

void Halo::start(std::uint64_t frame) {
  frame_ = frame;
  records_.clear();
  entries_.clear();
  told_.clear();
}

// A stable counting sort.
void Halo::finish(NodeNumber nodes) {
  from_.assign(nodes + 2, 0);
  for (const Entry& entry : entries_) {
    ++from_[entry.peer + 2];
  }
  for (NodeNumber peer = 0; peer < nodes; ++peer) {
    from_[peer + 2] += from_[peer + 1];
  }
  told_.resize(entries_.size());
  for (const Entry& entry : entries_) {
    told_[from_[entry.peer + 1]++] = entry.told;
  }
  from_.pop_back();
}

}  // namespace ringfence::nodes
