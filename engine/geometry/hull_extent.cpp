#include "geometry/hull.hpp"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "geometry/hull_extent.cpp"
#include <hwy/foreach_target.h>
#include <hwy/highway.h>

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
  for (std::size_t v = 0; v < count; v += hn::Lanes(d)) {
    const Vector vx = hn::Load(d, x + v), vy = hn::Load(d, y + v), vz = hn::Load(d, z + v);
    for (int i = 0; i < 3; ++i) {
      const Vector reach = hn::Add(hn::Add(hn::Mul(row[i][0], vx), hn::Mul(row[i][1], vy)), hn::Mul(row[i][2], vz));
      low[i] = v == 0 ? reach : hn::Min(low[i], reach);
      high[i] = v == 0 ? reach : hn::Max(high[i], reach);
    }
  }
  for (int i = 0; i < 3; ++i) {
    lower[i] = hn::GetLane(hn::MinOfLanes(d, low[i]));
    upper[i] = hn::GetLane(hn::MaxOfLanes(d, high[i]));
  }
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
