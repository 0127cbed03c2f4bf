#include "queries/reached_boxes.hpp"

#include <algorithm>
#include <new>

namespace ringfence::queries {

bool ReachedBoxes::reserve(std::size_t queries) noexcept try {
  constexpr std::size_t mean_boxes = 64;  // of a query
  reaches_.resize(queries);
  lists_.resize((max_levels + 1) * (queries + stream_slack));
  masks_.resize((max_levels + 1) * (queries + stream_slack));
  const std::size_t room = mean_boxes * queries + stream_slack;
  candidate_queries_.resize(room);
  candidate_boxes_.resize(room);
  candidate_at_.resize(room);
  ends_.resize(queries + 1);
  boxes_.resize(room);
  return true;
} catch (const std::bad_alloc&) {
  return false;
}

bool ReachedBoxes::find(BatchSearch search, const BoxTree& tree, std::size_t queries,
                        std::uint64_t& compared) noexcept {
  Candidates found{candidate_queries_.data(), candidate_boxes_.data(), candidate_at_.data(), 0, candidate_at_.size()};
  if (!search(tree, {reaches_.data(), queries}, {lists_.data(), masks_.data()}, found, compared)) {
    return false;
  }
  std::uint32_t* const ends = ends_.data();
  std::fill_n(ends, queries + 1, 0u);
  for (std::size_t i = 0; i < found.size; ++i) ++ends[found.queries[i] + 1];
  for (std::size_t i = 0; i < queries; ++i) ends[i + 1] += ends[i];
  // ends[i] is the begin of the list of query i, and becomes its end.
  for (std::size_t i = 0; i < found.size; ++i) boxes_[ends[found.queries[i]]++] = {found.boxes[i], found.at[i]};
  return true;
}

void ReachedBoxes::sort(std::size_t query) noexcept {
  ReachedBox* const first = boxes_.begin() + begin(query);
  ReachedBox* const last = boxes_.begin() + end(query);
  constexpr std::ptrdiff_t few = 16;
  if (last - first > few) {
    std::sort(first, last, [](const ReachedBox& p, const ReachedBox& q) { return p.at < q.at; });
    return;
  }
  for (ReachedBox* next = first; next != last; ++next) {
    const ReachedBox moved = *next;
    ReachedBox* to = next;
    for (; to != first && moved.at < to[-1].at; --to) *to = to[-1];
    *to = moved;
  }
}

}  // namespace ringfence::queries
