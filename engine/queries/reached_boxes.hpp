#pragma once

#include <cstddef>
#include <cstdint>
#include <span>

#include "base/flat_list.hpp"
#include "queries/tree_kernels.hpp"

namespace ringfence::queries {

/// A box that a query reaches.
struct ReachedBox {
  std::uint32_t box;  ///< position in the order of the tree
  float at;           ///< a lower bound of the fraction at which it is reached
};

/// What the queries of a block reach in a BoxTree: they descend it together.
///
/// Threads: belongs to one. Memory: grows to about two kilobytes for each query of the largest block, kept.
class ReachedBoxes {
 public:
  /// Prepares a block of this size. False if there is no memory for it.
  bool reserve(std::size_t queries) noexcept;
  /// What the i-th query reaches; to be set for each query.
  Reach& reach(std::size_t i) noexcept { return reaches_[i]; }
  /// Finds the boxes that the first `queries` queries reach by `search`; `compared` is increased by the number of boxes
  /// that were compared. False if they reach more than 96 each, in a level of the
  /// tree: then fewer have to be asked at a time.
  bool find(BatchSearch search, const BoxTree& tree, std::size_t queries, std::uint64_t& compared) noexcept;

  /// The boxes of all queries, one query after another; those of a query in the order of the tree.
  ReachedBox operator[](std::uint32_t i) const noexcept { return {candidate_boxes_[i], candidate_at_[i]}; }
  std::uint32_t begin(std::size_t query) const noexcept { return query == 0 ? 0 : ends_[query - 1]; }
  std::uint32_t end(std::size_t query) const noexcept { return ends_[query]; }
  /// Puts the nearest box of a query that is reached behind `begin` before its other boxes behind `begin`, and returns
  /// its place; end(query) if there is none.
  std::uint32_t start(std::size_t query, float begin) noexcept;
  /// The same for the boxes from `first` on, after the box before it: start() or this brought that there. `end` is that
  /// of the query.
  void bring_nearest(std::uint32_t first, std::uint32_t end) noexcept;

 private:
  void exchange(std::uint32_t i, std::uint32_t j) noexcept;
  void sort(std::uint32_t first, std::uint32_t last) noexcept;

  /// More boxes of a query are sorted at once. Of fewer, the nearest is searched each time: most queries test one or
  /// two.
  static constexpr std::uint32_t few = 16;

  base::FlatList<Reach> reaches_;
  base::FlatList<std::uint32_t> inner_queries_, inner_groups_;  ///< of the levels above the boxes
  base::FlatList<std::uint32_t> candidate_queries_, candidate_boxes_;
  base::FlatList<float> candidate_at_;
  base::FlatList<ReachedBox> sorted_;   ///< room for a query's boxes
  base::FlatList<std::uint32_t> ends_;  ///< of each query's boxes
};

}  // namespace ringfence::queries
