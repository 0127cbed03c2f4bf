// Searches in a BoxTree. Included once for each Highway target.

#if defined(RINGFENCE_QUERIES_SEARCHING_INL) == defined(HWY_TARGET_TOGGLE)
#ifdef RINGFENCE_QUERIES_SEARCHING_INL
#undef RINGFENCE_QUERIES_SEARCHING_INL
#else
#define RINGFENCE_QUERIES_SEARCHING_INL
#endif

#include <algorithm>
#include <array>
#include <bit>
#include <cstddef>
#include <cstdint>

#include <hwy/highway.h>

#include "geometry/front-inl.hpp"
#include "queries/tree_kernels.hpp"

HWY_BEFORE_NAMESPACE();
namespace ringfence::queries::HWY_NAMESPACE {

namespace hn = hwy::HWY_NAMESPACE;

using geometry::HWY_NAMESPACE::lanes_of;
using geometry::HWY_NAMESPACE::lanes_of_bits;

using Lanes = hn::CappedTag<float, tree_width>;

// Floats that come from three roundings each. A search may visit a box in vain, but not leave out one that counts.
constexpr float longer = 1 + 0x1p-20f;

HWY_INLINE std::uint32_t bits_of(hn::Mask<Lanes> mask) {
  std::uint8_t bytes[8];  // of which vectors of up to eight lanes set one
  hn::StoreMaskBits(Lanes(), mask, bytes);
  return bytes[0];
}

// When a moving box is within eight others.
class ReachTest {
 public:
  HWY_INLINE explicit ReachTest(const Reach& reach) {
    const Lanes d;
    for (std::size_t a = 0; a < 3; ++a) {
      // Along a falling axis, the far sides of the boxes are reached first.
      falls_[a] = reach.inverse[a] < 0;
      inverse_[a] = hn::Set(d, reach.inverse[a]);
      // The box that moves touches another from when its leading side reaches that one's near side.
      leading_[a] = hn::Set(d, falls_[a] ? reach.lower[a] : reach.upper[a]);
      trailing_[a] = hn::Set(d, falls_[a] ? reach.upper[a] : reach.lower[a]);
    }
  }

  // Writes to `at` when each box is reached, and returns the boxes that are reached by `limit`, as bits.
  HWY_INLINE std::uint32_t operator()(const BoxGroup& group, float limit, float* HWY_RESTRICT at) const {
    const Lanes d;
    std::uint32_t bits = 0;
    for (std::size_t lane = 0; lane < tree_width; lane += hn::Lanes(d)) {
      auto from = hn::Zero(d), to = hn::Set(d, limit);
      for (std::size_t a = 0; a < 3; ++a) {
        const float* const near_side = falls_[a] ? group.upper[a] : group.lower[a];
        const float* const far_side = falls_[a] ? group.lower[a] : group.upper[a];
        from = hn::Max(from, hn::Mul(hn::Sub(hn::Load(d, near_side + lane), leading_[a]), inverse_[a]));
        to = hn::Min(to, hn::Mul(hn::Sub(hn::Load(d, far_side + lane), trailing_[a]), inverse_[a]));
      }
      hn::Store(from, d, at + lane);
      const auto reached = hn::Le(from, hn::Mul(to, hn::Set(d, longer)));
      bits |= bits_of(reached) << lane;
    }
    return bits;
  }

 private:
  bool falls_[3];
  hn::Vec<Lanes> inverse_[3], leading_[3], trailing_[3];
};

// The largest squared distance, as computed, of a box that is within a number of metres. Finite, because an unused lane
// is at an infinite distance; no object is 10^18 m away.
inline float squared_bound(double metres) {
  const float distance = static_cast<float>(std::min(metres, 1e18)) * longer;
  return distance * distance * longer;
}

// How far eight boxes are from a point, in metres; squared.
class NearTest {
 public:
  HWY_INLINE explicit NearTest(const Reach& reach) {
    const Lanes d;
    for (std::size_t a = 0; a < 3; ++a) {
      lower_[a] = hn::Set(d, reach.lower[a]);
      upper_[a] = hn::Set(d, reach.upper[a]);
    }
  }

  HWY_INLINE std::uint32_t operator()(const BoxGroup& group, float limit, float* HWY_RESTRICT at) const {
    const Lanes d;
    std::uint32_t bits = 0;
    for (std::size_t lane = 0; lane < tree_width; lane += hn::Lanes(d)) {
      auto squared = hn::Zero(d);
      for (std::size_t a = 0; a < 3; ++a) {
        const auto below = hn::Sub(hn::Load(d, group.lower[a] + lane), upper_[a]);
        const auto above = hn::Sub(lower_[a], hn::Load(d, group.upper[a] + lane));
        const auto apart = hn::Max(hn::Zero(d), hn::Max(below, above));
        squared = hn::Add(squared, hn::Mul(apart, apart));
      }
      hn::Store(squared, d, at + lane);
      bits |= bits_of(hn::Le(squared, hn::Set(d, limit))) << lane;
    }
    return bits;
  }

 private:
  hn::Vec<Lanes> lower_[3], upper_[3];
};

// A depth-first search that visits the children of a node in the order of `at`. `bound(limit)` is the largest `at` that
// is of interest.
template <class Test, class Bound>
HWY_INLINE std::uint64_t search(const BoxTree& tree, const Test& test, double limit, const Bound& bound, VisitBox visit,
                                void* context) {
  struct Entry {
    float at;
    std::uint32_t level;  // of the group
    std::uint32_t group;
  };
  std::array<Entry, max_levels * tree_width> stack;
  std::size_t size = 0;
  std::uint64_t groups = 0;
  if (tree.size() == 0) return 0;
  const auto root = static_cast<std::uint32_t>(tree.levels() - 1);
  stack[size++] = {0, root, 0};
  float most = bound(limit);
  while (size != 0) {
    const Entry entry = stack[--size];
    if (entry.at > most) continue;
    alignas(32) float at[tree_width];
    std::uint32_t bits = test(tree.level(entry.level)[entry.group], most, at);
    ++groups;
    // In descending order of `at`, so that the nearest is on top.
    const std::size_t first = size;
    for (; bits != 0; bits &= bits - 1) {
      const auto lane = static_cast<std::uint32_t>(std::countr_zero(bits));
      std::size_t place = size++;
      for (; place > first && stack[place - 1].at < at[lane]; --place) stack[place] = stack[place - 1];
      stack[place] = {at[lane], entry.level - 1, static_cast<std::uint32_t>(entry.group * tree_width + lane)};
    }
    if (entry.level != 0) continue;
    while (size != first) {
      const Entry box = stack[--size];
      if (box.at > most) continue;
      limit = visit(context, box.group, limit);
      if (limit < 0) return groups * tree_width;
      most = bound(limit);
    }
  }
  return groups * tree_width;
}

inline std::uint64_t reach_boxes(const BoxTree& tree, const Reach& reach, double limit, VisitBox visit, void* context) {
  const auto bound = [](double fraction) { return static_cast<float>(fraction) * longer; };
  return search(tree, ReachTest(reach), limit, bound, visit, context);
}

inline std::uint64_t near_boxes(const BoxTree& tree, const Reach& reach, double limit, VisitBox visit, void* context) {
  return search(tree, NearTest(reach), limit, squared_bound, visit, context);
}

}  // namespace ringfence::queries::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#endif
