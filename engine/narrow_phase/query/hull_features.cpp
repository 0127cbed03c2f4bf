#include "narrow_phase/query/hull_features.hpp"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "narrow_phase/query/hull_features.cpp"
#include <hwy/foreach_target.h>
// This must follow foreach_target.h, which includes this file once for each target.
#include <cstddef>

#include "narrow_phase/simd/lanes-inl.hpp"
#include "narrow_phase/simd/largest-inl.hpp"

HWY_BEFORE_NAMESPACE();
namespace ringfence::narrow_phase::HWY_NAMESPACE {

namespace hn = hwy::HWY_NAMESPACE;

// A column is padded to 16 values, copies of the first, so that no vector passes its end.
using Floats = hn::CappedTag<float, 16>;
using Doubles = hn::CappedTag<double, 8>;

template <class D, class Point>
HWY_INLINE Vector<D> set_all(D d, const Point& p) {
  return {hn::Set(d, p.x), hn::Set(d, p.y), hn::Set(d, p.z)};
}
HWY_INLINE Vector<Floats> load_floats(const float* x, const float* y, const float* z) {
  const Floats d;
  return {hn::Load(d, x), hn::Load(d, y), hn::Load(d, z)};
}
HWY_INLINE Vector<Doubles> load_doubles(const float* x, const float* y, const float* z) {
  const Doubles d;
  const hn::Rebind<float, Doubles> floats;
  return {hn::PromoteTo(d, hn::LoadU(floats, x)), hn::PromoteTo(d, hn::LoadU(floats, y)),
          hn::PromoteTo(d, hn::LoadU(floats, z))};
}

// The largest of the values of features, and the lowest feature that has it.
template <class D>
struct Largest {
  hn::TFromD<D> value;
  std::uint32_t feature;
};
// `value_at(i)`: of the features from `i` on, one a lane.
template <class D, class ValueAt>
HWY_INLINE Largest<D> find_largest(std::size_t count, const ValueAt& value_at) {
  const D d;
  using T = hn::TFromD<D>;
  auto most = value_at(0), number = hn::Iota(d, 0), best = number;
  const auto step = hn::Set(d, static_cast<T>(hn::Lanes(d)));
  for (std::size_t i = hn::Lanes(d); i < count; i += hn::Lanes(d)) {
    number = hn::Add(number, step);
    const auto value = value_at(i);
    best = hn::IfThenElse(hn::Gt(value, most), number, best);
    most = hn::Max(value, most);
  }
  const auto found = largest_of_lanes(d, Numbered<D>{most, best});
  return {hn::GetLane(found.value), static_cast<std::uint32_t>(hn::GetLane(found.number))};
}

std::uint32_t farthest_vertex_of(const geometry::Hull& hull, const Vec3d& direction) {
  const Doubles d;
  const Vector<Doubles> along = set_all(d, direction);
  return find_largest<Doubles>(hull.vertex_count(),
                               [&](std::size_t i) HWY_ATTR {
                                 return dot(d, along, load_doubles(hull.x() + i, hull.y() + i, hull.z() + i));
                               })
      .feature;
}

double farthest_plane_of(const geometry::Hull& hull, const Vec3d& point) {
  const Doubles d;
  const Vector<Doubles> at = set_all(d, point);
  const hn::Rebind<float, Doubles> floats;
  return find_largest<Doubles>(
             hull.face_count(),
             [&](std::size_t i) HWY_ATTR {
               const auto normal = load_doubles(hull.normal_x() + i, hull.normal_y() + i, hull.normal_z() + i);
               return hn::Sub(dot(d, normal, at), hn::PromoteTo(d, hn::LoadU(floats, hull.offset() + i)));
             })
      .value;
}

HighestFace highest_face_of(const geometry::Hull& hull, const Vec3f& point) {
  const Floats d;
  const Vector<Floats> at = set_all(d, point);
  const auto found = find_largest<Floats>(hull.face_count(), [&](std::size_t i) HWY_ATTR {
    const auto normal = load_floats(hull.normal_x() + i, hull.normal_y() + i, hull.normal_z() + i);
    return hn::Sub(dot(d, normal, at), hn::Load(d, hull.offset() + i));
  });
  return {found.feature, found.value};
}

std::uint32_t nearest_edge_of(const geometry::Hull& hull, const Vec3f& point) {
  const Floats d;
  const Vector<Floats> at = set_all(d, point);
  const auto column = [&](geometry::EdgeColumn of, std::size_t i) { return hull.edge_column(of) + i; };
  return find_largest<Floats>(
             hull.edge_count(),
             [&](std::size_t i) HWY_ATTR {
               using geometry::EdgeColumn;
               const Vector<Floats> along = load_floats(column(EdgeColumn::along_x, i), column(EdgeColumn::along_y, i),
                                                        column(EdgeColumn::along_z, i));
               const Vector<Floats> from = load_floats(column(EdgeColumn::from_x, i), column(EdgeColumn::from_y, i),
                                                       column(EdgeColumn::from_z, i));
               const Vector<Floats> away = subtract(d, at, from);
               const auto length = hn::Load(d, column(EdgeColumn::length, i));
               const auto part = hn::Min(hn::Max(dot(d, away, along), hn::Zero(d)), length);
               const Vector<Floats> left = subtract(d, away, scale(d, along, part));
               return hn::Neg(dot(d, left, left));
             })
      .feature;
}

}  // namespace ringfence::narrow_phase::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace ringfence::narrow_phase {
HWY_EXPORT(farthest_vertex_of);
HWY_EXPORT(farthest_plane_of);
HWY_EXPORT(highest_face_of);
HWY_EXPORT(nearest_edge_of);

std::uint32_t farthest_vertex(const geometry::Hull& hull, const Vec3d& direction) noexcept {
  return HWY_DYNAMIC_DISPATCH(farthest_vertex_of)(hull, direction);
}
double farthest_plane(const geometry::Hull& hull, const Vec3d& point) noexcept {
  return HWY_DYNAMIC_DISPATCH(farthest_plane_of)(hull, point);
}
HighestFace highest_face(const geometry::Hull& hull, const Vec3f& point) noexcept {
  return HWY_DYNAMIC_DISPATCH(highest_face_of)(hull, point);
}
std::uint32_t nearest_edge(const geometry::Hull& hull, const Vec3f& point) noexcept {
  return HWY_DYNAMIC_DISPATCH(nearest_edge_of)(hull, point);
}
}  // namespace ringfence::narrow_phase
#endif
