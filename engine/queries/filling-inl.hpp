// The boxes of a BoxTree. Included once for each Highway target.

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

// Bounds and margins of eight siblings as columns.
struct BoundsGroup {
  alignas(32) std::uint32_t lower[3][tree_width];
  alignas(32) std::uint32_t upper[3][tree_width];
  alignas(32) std::uint32_t margin[tree_width];  // bits of floats
  alignas(32) std::uint32_t unused[tree_width];
};

// Writes the n-th words of four rows, of four words each, to column n.
HWY_INLINE void transpose(const std::uint32_t* const (&from)[4], std::uint32_t* HWY_RESTRICT columns) {
#if HWY_TARGET == HWY_SCALAR
  for (std::size_t n = 0; n < 4; ++n) {
    for (std::size_t i = 0; i < 4; ++i) columns[n * tree_width + i] = from[i][n];
  }
#else
  const hn::Full128<std::uint32_t> d;
  const hn::Vec<decltype(d)> rows[4] = {hn::Load(d, from[0]), hn::Load(d, from[1]), hn::Load(d, from[2]),
                                        hn::Load(d, from[3])};
  const auto low02 = hn::InterleaveLower(d, rows[0], rows[2]), low13 = hn::InterleaveLower(d, rows[1], rows[3]);
  const auto high02 = hn::InterleaveUpper(d, rows[0], rows[2]), high13 = hn::InterleaveUpper(d, rows[1], rows[3]);
  hn::Store(hn::InterleaveLower(d, low02, low13), d, columns);
  hn::Store(hn::InterleaveUpper(d, low02, low13), d, columns + tree_width);
  hn::Store(hn::InterleaveLower(d, high02, high13), d, columns + 2 * tree_width);
  hn::Store(hn::InterleaveUpper(d, high02, high13), d, columns + 3 * tree_width);
#endif
}

// Loads the rows of a group; behind the last row, it again.
HWY_INLINE void load_group(const RowOrder& leaves, std::size_t first, BoundsGroup& out) {
  static_assert(sizeof(BoundsGroup) == 8 * tree_width * sizeof(std::uint32_t));
  const std::size_t last = leaves.size - 1;
  std::uint32_t* const columns = &out.lower[0][0];
  for (std::size_t i = 0; i < tree_width; i += 4) {
    const std::uint32_t *left[4], *right[4];
    for (std::size_t j = 0; j < 4; ++j) {
      left[j] = reinterpret_cast<const std::uint32_t*>(&leaves[std::min(first + i + j, last)]);
      right[j] = left[j] + 4;
    }
    transpose(left, columns + i);
    transpose(right, columns + 4 * tree_width + i);
  }
}

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

HWY_INLINE bool is_within(const BoundsGroup& group, std::uint32_t first, std::uint32_t last) {
  const hn::CappedTag<std::uint32_t, 4> d;
  const auto begin = hn::Set(d, first), end = hn::Set(d, last);
  auto least = end, most = begin;
  for (std::size_t a = 0; a < 3; ++a) {
    for (std::size_t i = 0; i < tree_width; i += hn::Lanes(d)) {
      least = hn::Min(least, hn::Load(d, group.lower[a] + i));
      most = hn::Max(most, hn::Load(d, group.upper[a] + i));
    }
  }
  return hn::AllTrue(d, hn::And(hn::Eq(hn::Min(least, begin), begin), hn::Eq(hn::Max(most, end), end)));
}

// Sets the boxes of a group of leaves, of which `loaded` has the bounds.
HWY_INLINE void fill_group(const RowOrder& leaves, std::size_t first, const BoxConverter& box_of,
                           const BoundsGroup& loaded, BoxGroup& group) {
  const std::size_t count = std::min(tree_width, leaves.size - first);
  if (count == tree_width && is_within(loaded, box_of.first(), box_of.last())) {
    const auto* const margins = reinterpret_cast<const float*>(loaded.margin);
    for (std::size_t a = 0; a < 3; ++a) {
      convert(loaded.lower[a], margins, box_of, a, -1, group.lower[a]);
      convert(loaded.upper[a], margins, box_of, a, 1, group.upper[a]);
    }
    return;
  }
  for (std::size_t i = 0; i < count; ++i) {
    const TreeBox box = box_of(leaves[first + i]);
    for (std::size_t a = 0; a < 3; ++a) group.lower[a][i] = box.lower[a], group.upper[a][i] = box.upper[a];
  }
}

inline void fill_leaves(const RowOrder& leaves, const BoxConverter& box_of, std::span<const std::uint32_t> wanted,
                        BoxGroup* groups) {
  // Columns are read some groups after they are written, because wide loads of what narrow stores have just written
  // wait for these.
  constexpr std::size_t ahead = 4, batch = 4;
  BoundsGroup loaded[batch];
  for (std::size_t k = 0; k < wanted.size(); k += batch) {
    const std::size_t count = std::min(batch, wanted.size() - k);
    for (std::size_t j = 0; j < count; ++j) {
      const std::size_t soon = wanted[std::min(k + j + ahead, wanted.size() - 1)] * tree_width;
      for (std::size_t i = 0; i < tree_width; ++i) {
        base::prefetch_for_read(&leaves[std::min(soon + i, leaves.size - 1)]);
      }
      load_group(leaves, wanted[k + j] * tree_width, loaded[j]);
    }
    for (std::size_t j = 0; j < count; ++j) {
      fill_group(leaves, wanted[k + j] * tree_width, box_of, loaded[j], groups[wanted[k + j]]);
    }
  }
}

#if HWY_TARGET != HWY_SCALAR
// Lane i is the best of the eight floats `at(i)`, by `better`, which has no order.
template <class At, class Better>
HWY_INLINE auto best_of_four(const At& at, const Better& better) {
  const hn::Full128<float> d;
  const auto best = [&](std::size_t i) { return better(hn::Load(d, at(i)), hn::Load(d, at(i) + 4)); };
  const auto merge = [&](auto p, auto q) { return better(hn::InterleaveLower(d, p, q), hn::InterleaveUpper(d, p, q)); };
  return merge(merge(best(0), best(2)), merge(best(1), best(3)));
}
#endif

inline void fill_nodes(const BoxGroup* children, std::size_t count, BoxGroup& out) {
#if HWY_TARGET != HWY_SCALAR
  if (count == tree_width) {
    const hn::Full128<float> d;
    for (std::size_t i = 0; i < tree_width; i += 4) {
      for (std::size_t a = 0; a < 3; ++a) {
        const auto lower = [&](std::size_t j) { return children[i + j].lower[a]; };
        const auto upper = [&](std::size_t j) { return children[i + j].upper[a]; };
        hn::Store(best_of_four(lower, [](auto p, auto q) { return hn::Min(p, q); }), d, out.lower[a] + i);
        hn::Store(best_of_four(upper, [](auto p, auto q) { return hn::Max(p, q); }), d, out.upper[a] + i);
      }
    }
    return;
  }
#endif
  for (std::size_t i = 0; i < count; ++i) {
    for (std::size_t a = 0; a < 3; ++a) {
      out.lower[a][i] = *std::min_element(children[i].lower[a], children[i].lower[a] + tree_width);
      out.upper[a][i] = *std::max_element(children[i].upper[a], children[i].upper[a] + tree_width);
    }
  }
}

}  // namespace ringfence::queries::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#endif
