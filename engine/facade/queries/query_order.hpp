#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "base/pair_sort.hpp"
#include "ringfence/query.hpp"

namespace ringfence::facade {

/// An order in which queries that start near each other are near each other, so that they read the same parts of an
/// index. Answers do not depend on it.
///
/// Memory: 50 bytes for each query. May throw std::bad_alloc.
class QueryOrder {
 public:
  explicit QueryOrder(std::span<const RayQuery> queries);
  explicit QueryOrder(std::span<const SweepQuery> queries);
  explicit QueryOrder(std::span<const OverlapQuery> queries);
  explicit QueryOrder(std::span<const NearestQuery> queries);

  /// Index of the i-th query in this order.
  std::size_t operator[](std::size_t i) const noexcept { return sort_.at(i); }

 private:
  template <class Query, class Start>
  void sort(std::span<const Query> queries, Start start);
  base::PairSort sort_;
};

}  // namespace ringfence::facade
