#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "facade/queries/frame_store.hpp"
#include "queries/recorded_frame.hpp"
#include "queries/searcher.hpp"
#include "ringfence/query.hpp"

namespace ringfence::facade {

/// The frame that a query asks about, with the index that answers it: of the objects of the frame, or of several
/// frames.
struct QueryTarget {
  Status status = Status::ok;
  const queries::RecordedFrame* frame = nullptr;
  const queries::FramePart* standing = nullptr;  ///< or null
  const queries::SweptFrames* swept = nullptr;   ///< if `standing` is null
  queries::QueryTime time{};                     ///< of `swept`

  bool has_index_of(const QueryTarget& other) const noexcept {
    return standing == other.standing && swept == other.swept;
  }
};

/// `frames` may be null: out_of_order. Builds the index if this is the first query that needs it.
QueryTarget find_target(const PinnedFrames* frames, const QueryFrame& wanted) noexcept;

/// The order in which a batch is answered: that of the frames, so that queries with the same index follow each other.
/// Any thread; kept to be used again. May throw std::bad_alloc.
class FrameOrder {
 public:
  template <class Query>
  void set(std::span<const Query> queries) {
    order_.clear();
    for (const Query& query : queries) {
      if (query.frame) return sort(queries);
    }
  }
  /// Whether it is the order of the batch.
  bool is_given() const noexcept { return order_.empty(); }
  /// Index of the i-th query in this order.
  std::size_t operator[](std::size_t i) const noexcept { return order_.empty() ? i : order_[i].query; }

 private:
  struct Entry {
    double frame;
    std::uint32_t query;
  };
  template <class Query>
  void sort(std::span<const Query> queries) {
    for (const Query& query : queries) add(query.frame);
    sort_entries();
  }
  void add(const QueryFrame& frame);
  void sort_entries();

  std::vector<Entry> order_;  ///< empty: that of the batch
};

}  // namespace ringfence::facade
