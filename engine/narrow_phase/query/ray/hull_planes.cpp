#include "narrow_phase/query/ray/hull_planes.hpp"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "narrow_phase/query/ray/hull_planes.cpp"
#include <hwy/foreach_target.h>
// This must follow foreach_target.h, which includes this file once for each target.
#include <algorithm>
#include <cstddef>

#include "geometry/vector.hpp"
#include "narrow_phase/simd/lanes-inl.hpp"
#include "narrow_phase/simd/largest-inl.hpp"

HWY_BEFORE_NAMESPACE();
namespace ringfence::narrow_phase::HWY_NAMESPACE {

namespace hn = hwy::HWY_NAMESPACE;

using Doubles = hn::CappedTag<double, 8>;  // a column is padded to 16 values, so that no vector passes its end

HWY_INLINE Vector<Doubles> set(const Vec3d& p) {
  const Doubles d;
  return {hn::Set(d, p.x), hn::Set(d, p.y), hn::Set(d, p.z)};
}

PlaneClip clip(const geometry::Hull& hull, const LocalRay& ray, double margin) {
  const Doubles d;
  const hn::Rebind<float, Doubles> floats;
  const auto zero = hn::Zero(d), nowhere = hn::Set(d, -infinity), far = hn::Set(d, infinity);
  const Vector<Doubles> foot = set(ray.foot), direction = set(ray.direction), origin = set(ray.origin);
  auto enter = nowhere, leave = far, farthest = nowhere, entered = zero, number = hn::Iota(d, 0);
  for (std::size_t i = 0; i < hull.face_count(); i += hn::Lanes(d)) {
    const Vector<Doubles> normal{hn::PromoteTo(d, hn::LoadU(floats, hull.normal_x() + i)),
                                 hn::PromoteTo(d, hn::LoadU(floats, hull.normal_y() + i)),
                                 hn::PromoteTo(d, hn::LoadU(floats, hull.normal_z() + i))};
    const auto offset = hn::PromoteTo(d, hn::LoadU(floats, hull.offset() + i));
    farthest = hn::Max(farthest, hn::Sub(dot(d, normal, origin), offset));
    const auto at_foot = hn::Sub(dot(d, normal, foot), hn::Add(offset, hn::Set(d, margin)));
    const auto slope = dot(d, normal, direction);
    const auto place = hn::Neg(hn::Div(at_foot, slope));
    const auto later = hn::And(hn::Lt(slope, zero), hn::Gt(place, enter));
    enter = hn::IfThenElse(later, place, enter);
    entered = hn::IfThenElse(later, number, entered);
    const auto sooner = hn::And(hn::Gt(slope, zero), hn::Lt(place, leave));
    leave = hn::IfThenElse(sooner, place, leave);
    const auto outside = hn::And(hn::Eq(slope, zero), hn::Gt(at_foot, zero));
    leave = hn::IfThenElse(outside, nowhere, leave);
    number = hn::Add(number, hn::Set(d, static_cast<double>(hn::Lanes(d))));
  }
  const auto first = largest_of_lanes(d, Numbered<Doubles>{enter, entered});
  PlaneClip out;
  out.enter = hn::GetLane(first.value);
  out.entered = static_cast<std::uint32_t>(hn::GetLane(first.number));
  out.leave = -most_of_lanes(d, hn::Neg(leave));
  out.farthest = most_of_lanes(d, farthest);
  return out;
}

}  // namespace ringfence::narrow_phase::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace ringfence::narrow_phase {
HWY_EXPORT(clip);
PlaneClip clip_by_planes(const geometry::Hull& hull, const LocalRay& ray, double margin) {
  return HWY_DYNAMIC_DISPATCH(clip)(hull, ray, margin);
}
}  // namespace ringfence::narrow_phase
#endif
