#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "base/flat_list.hpp"
#include "base/numbers.hpp"
#include "base/renumbering.hpp"

namespace ringfence::nodes {

/// A list of numbers for each other node, each in the order of the add() calls.
///
/// Threads: one writer; others may read between finish() and the next clear(). Memory: grows to the largest frame.
class PeerLists {
 public:
  void reserve(std::size_t size) { entries_.reserve(size), values_.reserve(size); }
  void clear() noexcept { entries_.clear(), values_.clear(), from_.clear(); }
  void add(NodeNumber peer, std::uint32_t value) { entries_.push_back({peer, value}); }
  /// Call it after the last add(). `nodes` is the number of nodes; all peers are below it.
  void finish(NodeNumber nodes);
  /// After finish(), if the numbers are positions in another list, ascending: entries were removed from that list, at
  /// the positions `removed`, ascending. Removes these positions, and changes the others accordingly.
  void renumber(std::span<const std::uint32_t> removed) noexcept;

  /// The list of one peer; empty before finish(), and for a peer that is not below its `nodes`.
  std::span<const std::uint32_t> of(NodeNumber peer) const noexcept {
    return peer + std::size_t{1} < from_.size() ? values_.span().subspan(from_[peer], from_[peer + 1] - from_[peer])
                                                : std::span<const std::uint32_t>();
  }
  /// Calls visit(peer) for each peer whose list is not empty, ascending.
  template <class Visit>
  void each_peer(Visit visit) const {
    for (std::size_t peer = 0; peer + 1 < from_.size(); ++peer) {
      if (from_[peer] != from_[peer + 1]) {
        visit(static_cast<NodeNumber>(peer));
      }
    }
  }
  /// All lists together.
  std::size_t size() const noexcept { return values_.size(); }

 private:
  struct Entry {
    NodeNumber peer;
    std::uint32_t value;
  };
  base::FlatList<Entry> entries_;         ///< in the order of the add() calls
  base::FlatList<std::uint32_t> values_;  ///< by peer
  std::vector<std::uint32_t> from_;       ///< by peer, plus one: where its list begins
};

// A stable counting sort.
inline void PeerLists::finish(NodeNumber nodes) {
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

inline void PeerLists::renumber(std::span<const std::uint32_t> removed) noexcept {
  std::size_t begin = 0;
  std::uint32_t kept = 0;
  for (std::size_t peer = 0; peer + 1 < from_.size(); ++peer) {
    base::Renumbering place(removed);
    const std::size_t end = from_[peer + 1];
    for (std::size_t i = begin; i < end; ++i) {
      const std::uint32_t now = place(values_[i]);
      values_[kept] = now;
      kept += now != base::Renumbering::gone ? 1 : 0;
    }
    begin = end;
    from_[peer + 1] = kept;
  }
  values_.resize(kept);
}

}  // namespace ringfence::nodes
