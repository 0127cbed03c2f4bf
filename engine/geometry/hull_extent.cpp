#include <algorithm>
#include <cstdint>

#include "geometry/hull.hpp"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "geometry/hull_extent.cpp"
#include <hwy/foreach_target.h>
// After foreach_target.h.
#include "geometry/greatest-inl.hpp"

HWY_BEFORE_NAMESPACE();
namespace ringfence::geometry::HWY_NAMESPACE {

namespace hn = hwy::HWY_NAMESPACE;

// Greatest and least are exact in any order, so the reductions may depend on the width.
void extent(const float* x, const float* y, const float* z, std::size_t count, const float r[3][3], float lower[3],
            float upper[3]) {
  const hn::CappedTag<float, hull_lanes> d;
  using Vector = hn::Vec<decltype(d)>;
  Vector low[3], high[3], row[3][3];
  for (int i = 0; i < 3; ++i) {
    for (int j = 0; j < 3; ++j) row[i][j] = hn::Set(d, r[i][j]);
  }
  const auto reach = [&](int i, std::size_t v) HWY_ATTR {
    return hn::Add(hn::Add(hn::Mul(row[i][0], hn::Load(d, x + v)), hn::Mul(row[i][1], hn::Load(d, y + v))),
                   hn::Mul(row[i][2], hn::Load(d, z + v)));
  };
  for (int i = 0; i < 3; ++i) low[i] = high[i] = reach(i, 0);
  for (std::size_t v = hn::Lanes(d); v < count; v += hn::Lanes(d)) {
    for (int i = 0; i < 3; ++i) {
      low[i] = hn::Min(low[i], reach(i, v));
      high[i] = hn::Max(high[i], reach(i, v));
    }
  }
  float first[4], second[4];
  greatest_of_four(d, high[0], high[1], high[2], hn::Neg(low[0]), first);
  greatest_of_four(d, hn::Neg(low[1]), hn::Neg(low[2]), high[0], high[0], second);
  std::copy_n(first, 3, upper);
  lower[0] = -first[3];
  lower[1] = -second[0];
  lower[2] = -second[1];
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
