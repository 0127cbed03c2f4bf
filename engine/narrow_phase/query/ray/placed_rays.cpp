#include "narrow_phase/query/ray/placed_rays.hpp"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "narrow_phase/query/ray/placed_rays.cpp"
#include <hwy/foreach_target.h>
// This must follow foreach_target.h, which includes this file once for each target.
#include "narrow_phase/simd/lanes-inl.hpp"

HWY_BEFORE_NAMESPACE();
namespace ringfence::narrow_phase::HWY_NAMESPACE {

namespace hn = hwy::HWY_NAMESPACE;

using PlacedLanes = hn::CappedTag<double, 8>;
using Lane = hn::Vec<PlacedLanes>;

HWY_INLINE Vector<PlacedLanes> load(const PlacedRays::Columns& from, std::size_t i) {
  const PlacedLanes d;
  return {hn::Load(d, from.x + i), hn::Load(d, from.y + i), hn::Load(d, from.z + i)};
}
HWY_INLINE void store(const Vector<PlacedLanes>& p, PlacedRays::Columns& to, std::size_t i) {
  const PlacedLanes d;
  hn::Store(p.x, d, to.x + i);
  hn::Store(p.y, d, to.y + i);
  hn::Store(p.z, d, to.z + i);
}

// As geometry::rotation_exact().
HWY_INLINE Rotation<PlacedLanes> rotation_exact(const float (&q)[4][PlacedRays::most], std::size_t i) {
  const PlacedLanes d;
  const hn::Rebind<float, PlacedLanes> floats;
  const auto component = [&](std::size_t of) HWY_ATTR { return hn::PromoteTo(d, hn::Load(floats, q[of] + i)); };
  Lane x = component(0), y = component(1), z = component(2), w = component(3);
  const Lane norm = hn::Sqrt((x * x + y * y) + (z * z + w * w));
  x = x / norm, y = y / norm, z = z / norm, w = w / norm;
  const Lane x2 = x + x, y2 = y + y, z2 = z + z;
  const Lane xx = x * x2, yy = y * y2, zz = z * z2;
  const Lane xy = x * y2, xz = x * z2, yz = y * z2;
  const Lane wx = w * x2, wy = w * y2, wz = w * z2;
  const Lane one = hn::Set(d, 1.0);
  return {
      {{one - (yy + zz), xy - wz, xz + wy}, {xy + wz, one - (xx + zz), yz - wx}, {xz - wy, yz + wx, one - (xx + yy)}}};
}

// As LocalRay. Returns the rays whose lines miss the balls, as bits.
std::uint64_t place(const PlacedRays::In& in, std::size_t count, PlacedRays::Out& out) {
  const PlacedLanes d;
  std::uint64_t misses = 0;
  for (std::size_t i = 0; i < count; i += hn::Lanes(d)) {
    const Rotation<PlacedLanes> turn = rotation_exact(in.orientation, i);
    const auto origin = unrotate(d, turn, subtract(d, load(in.start, i), load(in.position, i)));
    const auto direction = unrotate(d, turn, load(in.direction, i));
    const Lane begin = dot(d, origin, direction);
    const auto foot = subtract(d, origin, scale(d, direction, begin));
    const Lane size = hn::Load(d, in.size + i);
    const Lane slack = hn::Set(d, 0x1p-46) * (size + hn::Sqrt(dot(d, origin, origin)));
    const auto missed = hn::Gt(dot(d, foot, foot), size * size * hn::Set(d, 1 + 0x1p-20) + slack * slack);
    std::uint8_t bytes[8] = {};  // of which vectors of up to eight lanes set one
    hn::StoreMaskBits(d, missed, bytes);
    misses |= std::uint64_t{bytes[0]} << i;
    store(origin, out.origin, i);
    store(direction, out.direction, i);
    store(foot, out.foot, i);
    hn::Store(begin, d, out.begin + i);
    hn::Store(slack, d, out.slack + i);
    for (std::size_t r = 0; r < 3; ++r) {
      for (std::size_t c = 0; c < 3; ++c) hn::Store(turn.m[r][c], d, out.rotation[r][c] + i);
    }
  }
  return misses;
}

}  // namespace ringfence::narrow_phase::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace ringfence::narrow_phase {
HWY_EXPORT(place);

void PlacedRays::add(const Ray& ray, const Pose& pose, double size) noexcept {
  const std::size_t i = size_++;
  in_.position.set(i, pose.position);
  in_.start.set(i, ray.start);
  in_.direction.set(i, ray.direction);
  const Quat& q = pose.orientation;
  in_.orientation[0][i] = q.x, in_.orientation[1][i] = q.y, in_.orientation[2][i] = q.z, in_.orientation[3][i] = q.w;
  in_.size[i] = size;
  in_.length[i] = ray.length;
}

void PlacedRays::run() noexcept {
  misses_ = HWY_DYNAMIC_DISPATCH(place)(in_, size_, out_);
  size_ = 0;
}

Pose PlacedRays::pose(std::size_t i) const noexcept {
  const auto& q = in_.orientation;
  return {in_.position.at(i), {q[0][i], q[1][i], q[2][i], q[3][i]}};
}

LocalRay PlacedRays::ray(std::size_t i) const noexcept {
  LocalRay ray;
  ray.origin = out_.origin.at(i);
  ray.direction = out_.direction.at(i);
  ray.foot = out_.foot.at(i);
  ray.begin = out_.begin[i];
  ray.end = out_.begin[i] + in_.length[i];
  ray.length = in_.length[i];
  ray.slack = out_.slack[i];
  return ray;
}

geometry::RotationD PlacedRays::rotation(std::size_t i) const noexcept {
  geometry::RotationD turn;
  for (std::size_t r = 0; r < 3; ++r) {
    for (std::size_t c = 0; c < 3; ++c) turn.m[r][c] = out_.rotation[r][c][i];
  }
  return turn;
}
}  // namespace ringfence::narrow_phase
#endif
