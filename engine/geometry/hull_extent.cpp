#include <algorithm>
#include <cstdint>

#include "geometry/hull.hpp"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "geometry/hull_extent.cpp"
#include <hwy/foreach_target.h>
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

/// The greatest lane of each of four vectors, in one of four lanes: twelve steps, where one vector after the other
/// would take thirty-two.
template <class D>
HWY_INLINE void greatest_of_four(D d, hn::Vec<D> a, hn::Vec<D> b, hn::Vec<D> c, hn::Vec<D> e, float out[4]) {
  const hn::Repartition<std::uint64_t, D> pairs;
  const auto ab = hn::Max(hn::InterleaveLower(d, a, b), hn::InterleaveUpper(d, a, b));
  const auto ce = hn::Max(hn::InterleaveLower(d, c, e), hn::InterleaveUpper(d, c, e));
  const auto lower = hn::InterleaveLower(pairs, hn::BitCast(pairs, ab), hn::BitCast(pairs, ce));
  const auto upper = hn::InterleaveUpper(pairs, hn::BitCast(pairs, ab), hn::BitCast(pairs, ce));
  const auto blocks = hn::Max(hn::BitCast(d, lower), hn::BitCast(d, upper));
  halve(d, blocks, out);
}
#endif

// Greatest and least are exact in any order, so the reductions may depend on the width.
void extent(const float* x, const float* y, const float* z, std::size_t count, const float r[3][3], float lower[3],
            float upper[3]) {
  const hn::CappedTag<float, hull_lanes> d;
  using Vector = hn::Vec<decltype(d)>;
  Vector low[3], high[3], row[3][3];
  for (int i = 0; i < 3; ++i) {
    for (int j = 0; j < 3; ++j) row[i][j] = hn::Set(d, r[i][j]);
  }
  for (std::size_t v = 0; v < count; v += hn::Lanes(d)) {
    const Vector vx = hn::Load(d, x + v), vy = hn::Load(d, y + v), vz = hn::Load(d, z + v);
    for (int i = 0; i < 3; ++i) {
      const Vector reach = hn::Add(hn::Add(hn::Mul(row[i][0], vx), hn::Mul(row[i][1], vy)), hn::Mul(row[i][2], vz));
      low[i] = v == 0 ? reach : hn::Min(low[i], reach);
      high[i] = v == 0 ? reach : hn::Max(high[i], reach);
    }
  }
#if HWY_TARGET == HWY_SCALAR
  for (int i = 0; i < 3; ++i) {
    lower[i] = hn::GetLane(low[i]);
    upper[i] = hn::GetLane(high[i]);
  }
#else
  float first[4], second[4];
  greatest_of_four(d, high[0], high[1], high[2], hn::Neg(low[0]), first);
  greatest_of_four(d, hn::Neg(low[1]), hn::Neg(low[2]), high[0], high[0], second);
  std::copy_n(first, 3, upper);
  lower[0] = -first[3];
  lower[1] = -second[0];
  lower[2] = -second[1];
#endif
}

}  // namespace ringfence::geometry::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace ringfence::geometry {

HWY_EXPORT(extent);

void hull_extent(const Hull& hull, const Rotation& r, float lower[3], float upper[3]) noexcept {
  HWY_DYNAMIC_DISPATCH(extent)(hull.x(), hull.y(), hull.z(), padded(hull.vertex_count()), r.m, lower, upper);
}

}  // namespace ringfence::geometry
#endif
