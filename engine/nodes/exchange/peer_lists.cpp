#include "nodes/exchange/peer_lists.hpp"

namespace ringfence::nodes {

// A stable counting sort.
void PeerLists::finish(NodeNumber nodes) {
  from_.assign(nodes + 2, 0);
  for (const Entry& entry : entries_) {
    ++from_[entry.peer + 2];
  }
  for (NodeNumber peer = 0; peer < nodes; ++peer) {
    from_[peer + 2] += from_[peer + 1];
  }
  values_.resize(entries_.size());
  for (const Entry& entry : entries_) {
    values_[from_[entry.peer + 1]++] = entry.value;
  }
  from_.pop_back();
}

}  // namespace ringfence::nodes
