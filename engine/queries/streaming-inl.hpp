// The boxes of a BoxTree that many queries reach. Included once for each Highway target.

#if defined(RINGFENCE_QUERIES_STREAMING_INL) == defined(HWY_TARGET_TOGGLE)
#ifdef RINGFENCE_QUERIES_STREAMING_INL
#undef RINGFENCE_QUERIES_STREAMING_INL
#else
#define RINGFENCE_QUERIES_STREAMING_INL
#endif

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <utility>

#include <hwy/highway.h>

#include "base/prefetch.hpp"
#include "queries/searching-inl.hpp"
#include "queries/tree_kernels.hpp"

HWY_BEFORE_NAMESPACE();
namespace ringfence::queries::HWY_NAMESPACE {

namespace hn = hwy::HWY_NAMESPACE;

// When boxes are reached by a moving box, and which are reached at all.
struct CompareReach {
  HWY_INLINE hn::Mask<Lanes> operator()(const BoxGroup& boxes, std::size_t lane, const Reach& reach,
                                        hn::Vec<Lanes>& at) const {
    const Lanes d;
    auto from = hn::Set(d, reach.begin), to = hn::Set(d, reach.limit);
    for (std::size_t a = 0; a < 3; ++a) {
      const auto inverse = hn::Set(d, reach.inverse[a]);
      const auto p = hn::Mul(hn::Sub(hn::Load(d, boxes.lower[a] + lane), hn::Set(d, reach.upper[a])), inverse);
      const auto q = hn::Mul(hn::Sub(hn::Load(d, boxes.upper[a] + lane), hn::Set(d, reach.lower[a])), inverse);
      from = hn::Max(from, hn::Min(p, q));
      to = hn::Min(to, hn::Max(p, q));
    }
    at = from;
    return hn::Le(from, hn::Mul(to, hn::Set(d, longer)));
  }
};

// How far boxes are from a point, squared, and which are within the limit.
struct CompareNear {
  HWY_INLINE hn::Mask<Lanes> operator()(const BoxGroup& boxes, std::size_t lane, const Reach& reach,
                                        hn::Vec<Lanes>& at) const {
    const Lanes d;
    auto squared = hn::Zero(d);
    for (std::size_t a = 0; a < 3; ++a) {
      const auto below = hn::Sub(hn::Load(d, boxes.lower[a] + lane), hn::Set(d, reach.upper[a]));
      const auto above = hn::Sub(hn::Set(d, reach.lower[a]), hn::Load(d, boxes.upper[a] + lane));
      const auto apart = hn::Max(hn::Zero(d), hn::Max(below, above));
      squared = hn::Add(squared, hn::Mul(apart, apart));
    }
    at = squared;
    return hn::Le(squared, hn::Set(d, squared_bound(double{reach.limit})));
  }
};

// Queries, and the groups that each of them reaches.
struct ReachedGroups {
  std::uint32_t* queries;
  std::uint32_t* groups;
};

// Compares each query of `from` with its group, and writes the children that it reaches to `to`; at level 0, also when
// they are reached, to `at`. Returns how many of them there are; `room` or more if there may be too many.
//
// No branch depends on what is reached: it writes whole vectors, and then says how many of their lanes count. So
// nothing waits for a comparison, and groups are loaded in advance.
template <bool is_leaf, class Compare>
HWY_INLINE std::size_t descend_level(const BoxTree& tree, std::size_t level, const Compare& compare,
                                     const Reach* HWY_RESTRICT reaches, const ReachedGroups& from, std::size_t count,
                                     const ReachedGroups& to, float* HWY_RESTRICT at, std::size_t room) {
  constexpr std::size_t ahead = 8;
  const Lanes d;
  const hn::Rebind<std::uint32_t, Lanes> numbers;
  const auto iota = hn::Iota(numbers, 0);
  const auto nodes = hn::Set(numbers, static_cast<std::uint32_t>(tree.nodes(level)));
  const BoxGroup* const HWY_RESTRICT groups = tree.level(level);
  std::uint32_t* const HWY_RESTRICT queries_out = to.queries;
  std::uint32_t* const HWY_RESTRICT groups_out = to.groups;
  std::size_t size = 0;
  for (std::size_t i = 0; i < count; ++i) {
    if (room - size < tree_width + stream_slack) return room;
    base::prefetch_object(groups[from.groups[std::min(i + ahead, count - 1)]]);
    const std::uint32_t query = from.queries[i], group = from.groups[i];
    for (std::size_t lane = 0; lane < tree_width; lane += hn::Lanes(d)) {
      const auto first = static_cast<std::uint32_t>(group * tree_width + lane);
      const auto children = hn::Add(hn::Set(numbers, first), iota);
      hn::Vec<Lanes> when;
      const auto reached =
          hn::And(compare(groups[group], lane, reaches[query], when), hn::RebindMask(d, hn::Lt(children, nodes)));
      hn::StoreU(hn::Set(numbers, query), numbers, queries_out + size);
      const auto lanes = lanes_of(d, reached);
      hn::StoreU(hn::Add(hn::Set(numbers, first), lanes), numbers, groups_out + size);
      if constexpr (is_leaf) hn::StoreU(hn::TableLookupLanes(when, hn::IndicesFromVec(d, lanes)), d, at + size);
      size += hn::CountTrue(d, reached);
    }
  }
  return size;
}

// Descends the tree with a whole batch, level by level. In exchange for what that saves, a query visits all boxes that
// it reaches, also behind its first hit.
template <class Compare>
HWY_INLINE bool search_all(const BoxTree& tree, const Compare& compare, std::span<const Reach> reaches,
                           const StreamMemory& memory, Candidates& out, std::uint64_t& boxes) {
  if (tree.size() == 0) return true;
  // Two lists in turn; level 0 writes to that of the caller.
  ReachedGroups from{memory.queries, memory.groups}, to{out.queries, out.boxes};
  if (tree.levels() % 2 == 0) std::swap(from, to);
  std::size_t count = reaches.size();
  for (std::size_t i = 0; i < count; ++i) from.queries[i] = static_cast<std::uint32_t>(i), from.groups[i] = 0;
  for (std::size_t level = tree.levels(); level-- != 0; std::swap(from, to)) {
    boxes += count * tree_width;
    count = level == 0 ? descend_level<true>(tree, level, compare, reaches.data(), from, count, to, out.at, out.room)
                       : descend_level<false>(tree, level, compare, reaches.data(), from, count, to, out.at, out.room);
    if (count == out.room) return false;
  }
  out.size = count;
  return true;
}

inline bool reach_all(const BoxTree& tree, std::span<const Reach> reaches, const StreamMemory& memory, Candidates& out,
                      std::uint64_t& boxes) {
  return search_all(tree, CompareReach(), reaches, memory, out, boxes);
}

inline bool near_all(const BoxTree& tree, std::span<const Reach> reaches, const StreamMemory& memory, Candidates& out,
                     std::uint64_t& boxes) {
  return search_all(tree, CompareNear(), reaches, memory, out, boxes);
}

}  // namespace ringfence::queries::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#endif
