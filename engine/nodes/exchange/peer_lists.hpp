#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "base/flat_list.hpp"
#include "ringfence/ids.hpp"

namespace ringfence::nodes {

/// What a CD node has for each of the others: a run of numbers a node, each in the order in which it was added.
///
/// Threads: one writer; others may read between finish() and the next clear(). Memory: grows to the largest frame.
class PeerLists {
 public:
  void reserve(std::size_t size);
  void clear() noexcept;
  void add(NodeNumber peer, std::uint32_t value) { entries_.push_back({peer, value}); }
  /// After the last of them; `nodes` is how many there are, and all peers are below it.
  void finish(NodeNumber nodes);

  /// After finish().
  std::span<const std::uint32_t> of(NodeNumber peer) const noexcept {
    return values_.span().subspan(from_[peer], from_[peer + 1] - from_[peer]);
  }
  /// Of all peers together.
  std::size_t size() const noexcept { return values_.size(); }

 private:
  struct Entry {
    NodeNumber peer;
    std::uint32_t value;
  };
  base::FlatList<Entry> entries_;         ///< as they came
  base::FlatList<std::uint32_t> values_;  ///< by peer
  std::vector<std::uint32_t> from_;       ///< by peer, and one more: where its run begins
};

}  // namespace ringfence::nodes
