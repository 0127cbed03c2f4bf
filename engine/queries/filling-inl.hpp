// The leaves of a BoxTree. Included once for each Highway target.

#if defined(RINGFENCE_QUERIES_FILLING_INL) == defined(HWY_TARGET_TOGGLE)
#ifdef RINGFENCE_QUERIES_FILLING_INL
#undef RINGFENCE_QUERIES_FILLING_INL
#else
#define RINGFENCE_QUERIES_FILLING_INL
#endif

#include <algorithm>
#include <cstddef>
#include <cstdint>

#include <hwy/highway.h>

#include "base/prefetch.hpp"
#include "queries/tree_kernels.hpp"

HWY_BEFORE_NAMESPACE();
namespace ringfence::queries::HWY_NAMESPACE {

namespace hn = hwy::HWY_NAMESPACE;

// The bounds of eight siblings as columns.
struct BoundsGroup {
  alignas(32) std::uint32_t lower[3][tree_width];
  alignas(32) std::uint32_t upper[3][tree_width];
  alignas(32) float margin[tree_width];
};

// Converts one side of eight boxes along one axis; `sign`: -1 for lower sides, 1 for upper ones.
HWY_INLINE void convert(const std::uint32_t* HWY_RESTRICT steps, const float* HWY_RESTRICT margins,
                        const BoxConverter& box_of, std::size_t axis, float sign, float* HWY_RESTRICT out) {
  const hn::CappedTag<double, tree_width> d;
  const hn::Rebind<float, decltype(d)> floats;
  const hn::Rebind<std::int32_t, decltype(d)> ints;
  // Steps are converted as signed integers, which are 2^31 less.
  const auto metres = hn::Set(d, box_of.metres(axis));
  const auto offset = hn::Set(d, box_of.offset(axis) + 0x1p31 * box_of.metres(axis));
  constexpr float rounding = BoxConverter::rounding;
  for (std::size_t i = 0; i < tree_width; i += hn::Lanes(d)) {
    const auto unsigned_steps = hn::Load(hn::RebindToUnsigned<decltype(ints)>(), steps + i);
    const auto less =
        hn::BitCast(ints, hn::Xor(unsigned_steps, hn::Set(hn::RebindToUnsigned<decltype(ints)>(), 0x80000000u)));
    const auto place = hn::DemoteTo(floats, hn::Add(hn::Mul(hn::PromoteTo(d, less), metres), offset));
    const auto more = hn::Mul(hn::Add(hn::Load(floats, margins + i), hn::Set(floats, box_of.slack(axis))),
                              hn::Set(floats, 1 + rounding));
    const auto wider = hn::Add(more, hn::Mul(hn::Abs(place), hn::Set(floats, rounding)));
    hn::Store(hn::Add(place, hn::Mul(wider, hn::Set(floats, sign))), floats, out + i);
  }
}

inline bool is_within(const BoundsGroup& group, std::uint32_t first, std::uint32_t last) {
  std::uint32_t least = last, most = first;
  for (std::size_t a = 0; a < 3; ++a) {
    for (std::size_t i = 0; i < tree_width; ++i) {
      least = std::min(least, group.lower[a][i]);
      most = std::max(most, group.upper[a][i]);
    }
  }
  return least >= first && most <= last;
}

// Sets the boxes of a group; false if one of its rows has no object.
HWY_INLINE bool fill_group(const RowOrder& leaves, std::size_t first, const BoxConverter& box_of, BoxGroup& group) {
  BoundsGroup loaded;
  const std::size_t count = std::min(tree_width, leaves.size - first);
  float least_margin = 0;
  for (std::size_t i = 0; i < tree_width; ++i) {
    const RowBounds& row = leaves[first + std::min(i, count - 1)];
    for (std::size_t a = 0; a < 3; ++a) {
      loaded.lower[a][i] = row.bounds.lower[a];
      loaded.upper[a][i] = row.bounds.upper[a];
    }
    loaded.margin[i] = row.margin;
    least_margin = std::min(least_margin, row.margin);
  }
  if (least_margin < 0) return false;
  if (count == tree_width && is_within(loaded, box_of.first(), box_of.last())) {
    for (std::size_t a = 0; a < 3; ++a) {
      convert(loaded.lower[a], loaded.margin, box_of, a, -1, group.lower[a]);
      convert(loaded.upper[a], loaded.margin, box_of, a, 1, group.upper[a]);
    }
    return true;
  }
  for (std::size_t i = 0; i < count; ++i) {
    const TreeBox box = box_of(leaves[first + i]);
    for (std::size_t a = 0; a < 3; ++a) group.lower[a][i] = box.lower[a], group.upper[a][i] = box.upper[a];
  }
  return true;
}

inline bool fill_leaves(const RowOrder& leaves, const BoxConverter& box_of, std::span<const std::uint32_t> wanted,
                        BoxGroup* groups) {
  constexpr std::size_t ahead = 4;
  for (std::size_t k = 0; k < wanted.size(); ++k) {
    const std::size_t soon = wanted[std::min(k + ahead, wanted.size() - 1)] * tree_width;
    for (std::size_t i = 0; i < tree_width; ++i) {
      base::prefetch_for_read(&leaves[std::min(soon + i, leaves.size - 1)]);
    }
    if (!fill_group(leaves, wanted[k] * tree_width, box_of, groups[wanted[k]])) return false;
  }
  return true;
}

}  // namespace ringfence::queries::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#endif
