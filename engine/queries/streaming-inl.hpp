// The boxes of a BoxTree that many queries reach. Included once for each Highway target.

#if defined(RINGFENCE_QUERIES_STREAMING_INL) == defined(HWY_TARGET_TOGGLE)
#ifdef RINGFENCE_QUERIES_STREAMING_INL
#undef RINGFENCE_QUERIES_STREAMING_INL
#else
#define RINGFENCE_QUERIES_STREAMING_INL
#endif

#include <bit>
#include <cstddef>
#include <cstdint>

#include <hwy/highway.h>

#include "queries/searching-inl.hpp"
#include "queries/tree_kernels.hpp"

HWY_BEFORE_NAMESPACE();
namespace ringfence::queries::HWY_NAMESPACE {

namespace hn = hwy::HWY_NAMESPACE;

// When eight boxes are reached by a moving box, and which are reached at all, as bits.
struct CompareReach {
  HWY_INLINE std::uint32_t operator()(const BoxGroup& boxes, const Reach& reach, float* HWY_RESTRICT at) const {
    const Lanes d;
    std::uint32_t bits = 0;
    for (std::size_t lane = 0; lane < tree_width; lane += hn::Lanes(d)) {
      auto from = hn::Set(d, reach.begin), to = hn::Set(d, reach.limit);
      for (std::size_t a = 0; a < 3; ++a) {
        const auto inverse = hn::Set(d, reach.inverse[a]);
        const auto p = hn::Mul(hn::Sub(hn::Load(d, boxes.lower[a] + lane), hn::Set(d, reach.upper[a])), inverse);
        const auto q = hn::Mul(hn::Sub(hn::Load(d, boxes.upper[a] + lane), hn::Set(d, reach.lower[a])), inverse);
        from = hn::Max(from, hn::Min(p, q));
        to = hn::Min(to, hn::Max(p, q));
      }
      hn::StoreU(from, d, at + lane);
      bits |= bits_of(hn::Le(from, hn::Mul(to, hn::Set(d, longer)))) << lane;
    }
    return bits;
  }
};

// How far eight boxes are from a point, squared, and which are within the limit, as bits.
struct CompareNear {
  HWY_INLINE std::uint32_t operator()(const BoxGroup& boxes, const Reach& reach, float* HWY_RESTRICT at) const {
    return NearTest(reach)(boxes, squared_bound(double{reach.limit}), at);
  }
};

// Descends the tree once for a whole batch: each group of boxes is compared with all queries that reach it. So its
// boxes are loaded once, and no query waits for memory or for a branch of its own. In exchange, a query visits all
// boxes that it reaches, also behind its first hit.
template <class Compare>
class Stream {
 public:
  HWY_INLINE Stream(const BoxTree& tree, const Compare& compare, const Reach* reaches, Candidates& out)
      : tree_(tree), compare_(compare), reaches_(reaches), out_(out) {}

  // Appends to the candidates what the first `count` entries of `queries` reach in a group and below. `masks` and
  // `queries` have room for what the levels below need. False if there are too many.
  bool descend(std::size_t level, std::uint32_t group, std::uint32_t* queries, std::size_t count, std::uint8_t* masks) {
    groups_ += count;
    const BoxGroup& boxes = tree_.level(level)[group];
    const std::uint32_t used = tree_.used_lanes(level, group);
    if (level == 0) return list(boxes, used, group, queries, count);
    std::uint32_t reached = 0;
    for (std::size_t i = 0; i < count; ++i) {
      alignas(32) float at[tree_width];
      const std::uint32_t bits = compare_(boxes, reaches_[queries[i]], at) & used;
      masks[i] = static_cast<std::uint8_t>(bits);
      reached |= bits;
    }
    for (std::size_t i = 0; i < stream_slack; ++i) masks[count + i] = 0;
    std::uint32_t* const below = queries + count + stream_slack;
    for (; reached != 0; reached &= reached - 1) {
      const auto child = static_cast<std::uint32_t>(std::countr_zero(reached));
      const std::size_t chosen = select(queries, masks, count, child, below);
      if (!descend(level - 1, static_cast<std::uint32_t>(group * tree_width + child), below, chosen,
                   masks + count + stream_slack)) {
        return false;
      }
    }
    return true;
  }

  std::uint64_t groups() const { return groups_; }

 private:
  // The queries whose mask has the bit of a child. Returns how many.
  static HWY_INLINE std::size_t select(const std::uint32_t* queries, const std::uint8_t* masks, std::size_t count,
                                       std::uint32_t child, std::uint32_t* chosen) {
    const hn::ScalableTag<std::uint32_t> d;
    const hn::Rebind<std::uint8_t, decltype(d)> bytes;
    const auto bit = hn::Set(d, 1u << child);
    std::size_t size = 0;
    for (std::size_t i = 0; i < count; i += hn::Lanes(d)) {
      const auto mask = hn::TestBit(hn::PromoteTo(d, hn::LoadU(bytes, masks + i)), bit);
      hn::StoreU(hn::Compress(hn::LoadU(d, queries + i), mask), d, chosen + size);
      size += hn::CountTrue(d, mask);
    }
    return size;
  }

  // Writes whole vectors behind the candidates and then says how many of their lanes count, so that there is no branch
  // that depends on what is reached.
  bool list(const BoxGroup& boxes, std::uint32_t used, std::uint32_t group, const std::uint32_t* queries,
            std::size_t count) {
    const Lanes d;
    const hn::Rebind<std::uint32_t, Lanes> numbers;
    std::size_t size = out_.size;
    if (out_.room - size < count * tree_width + stream_slack) return false;
    for (std::size_t i = 0; i < count; ++i) {
      alignas(32) float at[tree_width];
      const std::uint32_t bits = compare_(boxes, reaches_[queries[i]], at) & used;
      for (std::size_t lane = 0; lane < tree_width; lane += hn::Lanes(d)) {
        const auto first = static_cast<std::uint32_t>(group * tree_width + lane);
        const std::uint32_t mine = bits >> lane & ((1u << hn::Lanes(d)) - 1);
        const std::uint8_t bytes[8] = {static_cast<std::uint8_t>(mine)};
        hn::StoreU(hn::Set(numbers, queries[i]), numbers, out_.queries + size);
        hn::StoreU(hn::Compress(hn::Iota(numbers, first), hn::LoadMaskBits(numbers, bytes)), numbers,
                   out_.boxes + size);
        hn::StoreU(hn::Compress(hn::LoadU(d, at + lane), hn::LoadMaskBits(d, bytes)), d, out_.at + size);
        size += static_cast<std::size_t>(std::popcount(mine));
      }
    }
    out_.size = size;
    return true;
  }

  const BoxTree& tree_;
  const Compare compare_;
  const Reach* reaches_;
  Candidates& out_;
  std::uint64_t groups_ = 0;
};

template <class Compare>
HWY_INLINE bool search_all(const BoxTree& tree, const Compare& compare, std::span<const Reach> reaches,
                           const StreamMemory& memory, Candidates& out, std::uint64_t& boxes) {
  if (tree.size() == 0) return true;
  for (std::size_t i = 0; i < reaches.size(); ++i) memory.queries[i] = static_cast<std::uint32_t>(i);
  Stream<Compare> stream(tree, compare, reaches.data(), out);
  const bool complete = stream.descend(tree.levels() - 1, 0, memory.queries, reaches.size(), memory.masks);
  boxes += stream.groups() * tree_width;
  return complete;
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
