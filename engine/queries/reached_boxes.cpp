#include "queries/reached_boxes.hpp"

#include <algorithm>
#include <new>

namespace ringfence::queries {

bool ReachedBoxes::reserve(std::size_t queries) noexcept try {
  constexpr std::size_t mean_boxes = 96;  // of a query
  reaches_.resize(queries);
  const std::size_t room = mean_boxes * queries + stream_slack;
  inner_queries_.resize(room);
  inner_groups_.resize(room);
  candidate_queries_.resize(room);
  candidate_boxes_.resize(room);
  candidate_at_.resize(room);
  ends_.resize(queries);
  boxes_.resize(room);
  return true;
} catch (const std::bad_alloc&) {
  return false;
}

bool ReachedBoxes::find(BatchSearch search, const BoxTree& tree, std::size_t queries,
                        std::uint64_t& compared) noexcept {
  Candidates found{candidate_queries_.data(), candidate_boxes_.data(), candidate_at_.data(), 0, candidate_at_.size()};
  const StreamMemory memory{inner_queries_.data(), inner_groups_.data()};
  if (!search(tree, {reaches_.data(), queries}, memory, found, compared)) return false;
  std::size_t query = 0;
  for (std::uint32_t i = 0; i < found.size; ++i) {
    boxes_[i] = {found.boxes[i], found.at[i]};
    while (query < found.queries[i]) ends_[query++] = i;
  }
  while (query < queries) ends_[query++] = static_cast<std::uint32_t>(found.size);
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
