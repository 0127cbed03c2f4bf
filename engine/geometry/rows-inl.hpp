// Rows of four floats to and from vectors of lanes. Included once for each Highway target.

#if defined(RINGFENCE_GEOMETRY_ROWS_INL) == defined(HWY_TARGET_TOGGLE)
#ifdef RINGFENCE_GEOMETRY_ROWS_INL
#undef RINGFENCE_GEOMETRY_ROWS_INL
#else
#define RINGFENCE_GEOMETRY_ROWS_INL
#endif

#include <cstddef>
#include <cstdint>

#include <hwy/highway.h>

HWY_BEFORE_NAMESPACE();
namespace ringfence::geometry::HWY_NAMESPACE {

namespace hn = hwy::HWY_NAMESPACE;

#if HWY_TARGET != HWY_SCALAR

/// Converts four rows to four vectors of lanes, and back: transposes the 4 x 4 matrix in each 128-bit block.
template <class D>
HWY_INLINE void transpose(D d, hn::Vec<D> a, hn::Vec<D> b, hn::Vec<D> c, hn::Vec<D> e, hn::Vec<D>* out) {
  const hn::Repartition<std::uint64_t, D> wide;
  const auto ab_lower = hn::BitCast(wide, hn::InterleaveLower(d, a, b));
  const auto ab_upper = hn::BitCast(wide, hn::InterleaveUpper(d, a, b));
  const auto ce_lower = hn::BitCast(wide, hn::InterleaveLower(d, c, e));
  const auto ce_upper = hn::BitCast(wide, hn::InterleaveUpper(d, c, e));
  out[0] = hn::BitCast(d, hn::InterleaveLower(wide, ab_lower, ce_lower));
  out[1] = hn::BitCast(d, hn::InterleaveUpper(wide, ab_lower, ce_lower));
  out[2] = hn::BitCast(d, hn::InterleaveLower(wide, ab_upper, ce_upper));
  out[3] = hn::BitCast(d, hn::InterleaveUpper(wide, ab_upper, ce_upper));
}

/// Joins one row of each 128-bit block of lanes to one vector: `row(lane)` points to four floats.
template <class D, class Row>
HWY_INLINE hn::Vec<D> join_rows(D d, const Row& row, std::size_t lane) {
  if constexpr (hn::MaxLanes(D()) == 4) {
    return hn::LoadU(d, row(lane));
  } else {
    const hn::Half<D> half;
    return hn::Combine(d, join_rows(half, row, lane + hn::MaxLanes(half)), join_rows(half, row, lane));
  }
}

#endif

/// Loads four floats of each lane's row into four vectors of lanes; `row(lane)` points to them. Does not go through
/// memory, where the wide loads would wait for the narrow stores.
template <class D, class Row>
HWY_INLINE void gather_rows(D d, const Row& row, hn::Vec<D>* out) {
#if HWY_TARGET == HWY_SCALAR
  for (int k = 0; k < 4; ++k) out[k] = hn::Set(d, row(0)[k]);
#else
  transpose(d, join_rows(d, row, 0), join_rows(d, row, 1), join_rows(d, row, 2), join_rows(d, row, 3), out);
#endif
}

}  // namespace ringfence::geometry::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#endif
