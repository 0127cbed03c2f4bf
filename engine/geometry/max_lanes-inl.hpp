// The maximum lane of each of four vectors. Included once for each Highway target.

#if defined(RINGFENCE_GEOMETRY_GREATEST_INL) == defined(HWY_TARGET_TOGGLE)
#ifdef RINGFENCE_GEOMETRY_GREATEST_INL
#undef RINGFENCE_GEOMETRY_GREATEST_INL
#else
#define RINGFENCE_GEOMETRY_GREATEST_INL
#endif

#include <cstdint>

#include <hwy/highway.h>

HWY_BEFORE_NAMESPACE();
namespace ringfence::geometry::HWY_NAMESPACE {

namespace hn = hwy::HWY_NAMESPACE;

#if HWY_TARGET != HWY_SCALAR
/// Reduces a vector of one or more blocks of four lanes to one block: lane i of `out` is the maximum of lane i of all
/// blocks.
template <class D>
HWY_INLINE void reduce_blocks(D d, hn::Vec<D> blocks, float out[4]) {
  if constexpr (hn::MaxLanes(D()) == 4) {
    hn::StoreU(blocks, d, out);
  } else {
    const hn::Half<D> half;
    reduce_blocks(half, hn::Max(hn::LowerHalf(half, blocks), hn::UpperHalf(half, blocks)), out);
  }
}
#endif

/// Stores the maximum lane of each of the four vectors in `out`, in the order a, b, c, e. With eight lanes this takes
/// twelve instructions; reducing one vector after the other takes 32. A maximum is exact in any order, so the result
/// does not depend on the vector width. Precondition: no lane is NaN; the number of lanes is a multiple of 4, or 1 on
/// the scalar target.
template <class D>
HWY_INLINE void max_lanes_of_four([[maybe_unused]] D d, hn::Vec<D> a, hn::Vec<D> b, hn::Vec<D> c, hn::Vec<D> e,
                                  float out[4]) {
#if HWY_TARGET == HWY_SCALAR
  const hn::Vec<D> each[4] = {a, b, c, e};
  for (int i = 0; i < 4; ++i) out[i] = hn::GetLane(each[i]);
#else
  const hn::Repartition<std::uint64_t, D> pairs;
  const auto ab = hn::Max(hn::InterleaveLower(d, a, b), hn::InterleaveUpper(d, a, b));
  const auto ce = hn::Max(hn::InterleaveLower(d, c, e), hn::InterleaveUpper(d, c, e));
  const auto lower = hn::InterleaveLower(pairs, hn::BitCast(pairs, ab), hn::BitCast(pairs, ce));
  const auto upper = hn::InterleaveUpper(pairs, hn::BitCast(pairs, ab), hn::BitCast(pairs, ce));
  const auto blocks = hn::Max(hn::BitCast(d, lower), hn::BitCast(d, upper));
  reduce_blocks(d, blocks, out);
#endif
}

}  // namespace ringfence::geometry::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#endif
