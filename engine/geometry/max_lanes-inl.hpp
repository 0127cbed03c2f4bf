// The greatest lanes of four vectors at once. Included once for each Highway target.

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
/// Down to a block of four lanes, each the greatest of its lanes in all blocks.
template <class D>
HWY_INLINE void halve(D d, hn::Vec<D> blocks, float out[4]) {
  if constexpr (hn::MaxLanes(D()) == 4) {
    hn::StoreU(blocks, d, out);
  } else {
    const hn::Half<D> half;
    halve(half, hn::Max(hn::LowerHalf(half, blocks), hn::UpperHalf(half, blocks)), out);
  }
}
#endif

/// The greatest lane of each of four vectors: twelve steps, where one vector after the other would take thirty-two.
/// Greatest is exact in any order, so it does not matter that the order depends on the width.
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
  halve(d, blocks, out);
#endif
}

}  // namespace ringfence::geometry::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#endif
