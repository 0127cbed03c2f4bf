#include "queries/reached_boxes.hpp"

#include <algorithm>
#include <new>
#include <utility>

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
  sorted_.reserve_rarely_used(room);
  ends_.resize(queries);
  return true;
} catch (const std::bad_alloc&) {
  return false;
}

bool ReachedBoxes::find(BatchSearch search, const BoxTree& tree, std::size_t queries,
                        std::uint64_t& compared) noexcept {
  Candidates found{candidate_queries_.data(), candidate_boxes_.data(), candidate_at_.data(), 0, candidate_at_.size()};
  const StreamMemory memory{inner_queries_.data(), inner_groups_.data()};
  if (!search(tree, {reaches_.data(), queries}, memory, found, compared)) return false;
  // Without a branch: how many boxes a query reaches cannot be predicted.
  std::fill(ends_.begin(), ends_.begin() + queries, 0);
  for (std::uint32_t i = 0; i < found.size; ++i) ends_[found.queries[i]] = i + 1;
  for (std::size_t i = 1; i < queries; ++i) ends_[i] = std::max(ends_[i], ends_[i - 1]);
  return true;
}

std::uint32_t ReachedBoxes::start(std::size_t query, float begin) noexcept {
  std::uint32_t first = this->begin(query);
  const std::uint32_t last = end(query);
  for (std::uint32_t i = first; begin > 0 && i != last; ++i) {
    const bool is_before = candidate_at_[i] <= begin;
    exchange(first, i);
    first += is_before ? 1 : 0;
  }
  if (last - first > few) {
    sort(first, last);
  } else {
    bring_nearest(first, last);
  }
  return first;
}

void ReachedBoxes::sort(std::uint32_t first, std::uint32_t last) noexcept {
  sorted_.clear();
  for (std::uint32_t i = first; i != last; ++i) sorted_.push_back((*this)[i]);
  std::sort(sorted_.begin(), sorted_.end(), [](const ReachedBox& p, const ReachedBox& q) { return p.at < q.at; });
  for (const ReachedBox& next : sorted_.span()) {
    candidate_boxes_[first] = next.box;
    candidate_at_[first] = next.at;
    ++first;
  }
}

void ReachedBoxes::bring_nearest(std::uint32_t first, std::uint32_t end) noexcept {
  if (first == end) return;
  std::uint32_t nearest = first;
  // What was sorted is as it should be.
  const std::uint32_t last = std::min(end, first + few);
  for (std::uint32_t i = first + 1; i < last; ++i) nearest = candidate_at_[i] < candidate_at_[nearest] ? i : nearest;
  exchange(first, nearest);
}

void ReachedBoxes::exchange(std::uint32_t i, std::uint32_t j) noexcept {
  std::swap(candidate_boxes_[i], candidate_boxes_[j]);
  std::swap(candidate_at_[i], candidate_at_[j]);
}

}  // namespace ringfence::queries
