// Vectors, rotations and clamps in SIMD lanes: each lane is one pair. Included once for each Highway target.
//
// Every function is a fixed sequence of IEEE operations within each lane, so the bits do not depend on the vector
// width. No function uses a fused multiply-add or an approximate reciprocal. `Min` and `Max` are used only where NaN
// and the sign of a zero do not matter, because targets differ in these cases.

#if defined(RINGFENCE_NARROW_PHASE_LANES_INL) == defined(HWY_TARGET_TOGGLE)
#ifdef RINGFENCE_NARROW_PHASE_LANES_INL
#undef RINGFENCE_NARROW_PHASE_LANES_INL
#else
#define RINGFENCE_NARROW_PHASE_LANES_INL
#endif

#include <hwy/highway.h>

HWY_BEFORE_NAMESPACE();
namespace ringfence::narrow_phase::HWY_NAMESPACE {

namespace hn = hwy::HWY_NAMESPACE;

template <class D>
using Scalar = hn::TFromD<D>;

template <class D>
struct Vector {
  hn::Vec<D> x, y, z;
};

template <class D>
struct Quaternion {
  hn::Vec<D> x, y, z, w;
};

/// A rotation matrix: m[row][column].
template <class D>
struct Rotation {
  hn::Vec<D> m[3][3];
};

template <class D>
HWY_INLINE Vector<D> add(D, const Vector<D>& p, const Vector<D>& q) {
  return {p.x + q.x, p.y + q.y, p.z + q.z};
}

template <class D>
HWY_INLINE Vector<D> subtract(D, const Vector<D>& p, const Vector<D>& q) {
  return {p.x - q.x, p.y - q.y, p.z - q.z};
}

template <class D>
HWY_INLINE Vector<D> scale(D, const Vector<D>& p, hn::Vec<D> s) {
  return {p.x * s, p.y * s, p.z * s};
}

template <class D>
HWY_INLINE Vector<D> negate(D, const Vector<D>& p) {
  return {hn::Neg(p.x), hn::Neg(p.y), hn::Neg(p.z)};
}

template <class D>
HWY_INLINE hn::Vec<D> dot(D, const Vector<D>& p, const Vector<D>& q) {
  return p.x * q.x + p.y * q.y + p.z * q.z;
}

template <class D>
HWY_INLINE Vector<D> cross(D, const Vector<D>& p, const Vector<D>& q) {
  return {p.y * q.z - p.z * q.y, p.z * q.x - p.x * q.z, p.x * q.y - p.y * q.x};
}

template <class D>
HWY_INLINE Vector<D> choose(D, hn::Mask<D> mask, const Vector<D>& yes, const Vector<D>& no) {
  return {hn::IfThenElse(mask, yes.x, no.x), hn::IfThenElse(mask, yes.y, no.y), hn::IfThenElse(mask, yes.z, no.z)};
}

/// `v` clamped to [-limit, limit]; limit >= 0.
template <class D>
HWY_INLINE hn::Vec<D> limited(D, hn::Vec<D> v, hn::Vec<D> limit) {
  return hn::Max(hn::Min(v, limit), hn::Neg(limit));
}

/// The signed distance by which `v` lies outside [-limit, limit]; exactly zero inside.
template <class D>
HWY_INLINE hn::Vec<D> excess(D d, hn::Vec<D> v, hn::Vec<D> limit) {
  return v - limited(d, v, limit);
}

/// 1 with the sign of `v`, also for signed zeros.
template <class D>
HWY_INLINE hn::Vec<D> sign_of(D d, hn::Vec<D> v) {
  return hn::CopySignToAbs(hn::Set(d, Scalar<D>{1}), v);
}

/// The components by which the others are multiplied in a rotation matrix: twice x, y and z. In double, the rounding of
/// the quaternion's components to float would be visible, so they are scaled to normalise the matrix. In float, that
/// error is as small as any other rounding.
template <class D>
HWY_INLINE Vector<D> product_factors(D d, const Quaternion<D>& q) {
  if constexpr (sizeof(Scalar<D>) == 8) {
    const auto s = hn::Set(d, 2.0) / (q.x * q.x + q.y * q.y + q.z * q.z + q.w * q.w);
    return {q.x * s, q.y * s, q.z * s};
  } else {
    return {q.x + q.x, q.y + q.y, q.z + q.z};  // not a product: kernels have more of these than sums
  }
}

template <class D>
HWY_INLINE Rotation<D> rotation(D d, const Quaternion<D>& q) {
  const auto [x2, y2, z2] = product_factors(d, q);
  const auto xx = q.x * x2, yy = q.y * y2, zz = q.z * z2;
  const auto xy = q.x * y2, xz = q.x * z2, yz = q.y * z2;
  const auto wx = q.w * x2, wy = q.w * y2, wz = q.w * z2;
  const auto one = hn::Set(d, Scalar<D>{1});
  return {{{one - yy - zz, xy - wz, xz + wy}, {xy + wz, one - xx - zz, yz - wx}, {xz - wy, yz + wx, one - xx - yy}}};
}

/// The third column of the rotation: the direction of a capsule's axis.
template <class D>
HWY_INLINE Vector<D> z_axis(D d, const Quaternion<D>& q) {
  const auto [x2, y2, z2] = product_factors(d, q);
  return {q.x * z2 + q.w * y2, q.y * z2 - q.w * x2, hn::Set(d, Scalar<D>{1}) - q.x * x2 - q.y * y2};
}

template <class D>
HWY_INLINE Vector<D> column(const Rotation<D>& r, int c) {
  return {r.m[0][c], r.m[1][c], r.m[2][c]};
}

/// Converts `v` from the rotated axes to the outer axes.
template <class D>
HWY_INLINE Vector<D> rotate(D, const Rotation<D>& r, const Vector<D>& v) {
  return {r.m[0][0] * v.x + r.m[0][1] * v.y + r.m[0][2] * v.z, r.m[1][0] * v.x + r.m[1][1] * v.y + r.m[1][2] * v.z,
          r.m[2][0] * v.x + r.m[2][1] * v.y + r.m[2][2] * v.z};
}

/// Converts `v` from the outer axes to the rotated axes.
template <class D>
HWY_INLINE Vector<D> unrotate(D, const Rotation<D>& r, const Vector<D>& v) {
  return {r.m[0][0] * v.x + r.m[1][0] * v.y + r.m[2][0] * v.z, r.m[0][1] * v.x + r.m[1][1] * v.y + r.m[2][1] * v.z,
          r.m[0][2] * v.x + r.m[1][2] * v.y + r.m[2][2] * v.z};
}

/// The same with a unit quaternion: fewer operations than to compute its matrix first, for a single vector.
template <class D>
HWY_INLINE Vector<D> unrotate(D d, const Quaternion<D>& q, const Vector<D>& v) {
  const Vector<D> axis{q.x, q.y, q.z};
  const Vector<D> turn = cross(d, add(d, axis, axis), v);
  return add(d, subtract(d, v, scale(d, turn, q.w)), cross(d, axis, turn));
}

/// The rotation q in the axes of p.
template <class D>
HWY_INLINE Quaternion<D> relative(D, const Quaternion<D>& p, const Quaternion<D>& q) {
  return {p.w * q.x - p.x * q.w - p.y * q.z + p.z * q.y, p.w * q.y - p.y * q.w - p.z * q.x + p.x * q.z,
          p.w * q.z - p.z * q.w - p.x * q.y + p.y * q.x, p.w * q.w + p.x * q.x + p.y * q.y + p.z * q.z};
}

/// A vector perpendicular to the unit vector `u`, of length 0.6 to 1.
template <class D>
HWY_INLINE Vector<D> perpendicular(D d, const Vector<D>& u) {
  const auto zero = hn::Zero(d);
  const auto flat = hn::Abs(u.z) < hn::Set(d, Scalar<D>(0.75));
  return choose(d, flat, Vector<D>{u.y, zero - u.x, zero}, Vector<D>{zero, u.z, zero - u.y});
}

/// Squared lengths below this value, in square metres, count as zero. It is far below the rounding errors for sizes of
/// one millimetre or more.
template <class D>
HWY_INLINE hn::Vec<D> no_length(D d) {
  return hn::Set(d, sizeof(Scalar<D>) == 8 ? Scalar<D>(1e-60) : Scalar<D>(1e-30));
}

/// The result of a kernel: the contact of one pair in each lane.
template <class D>
struct LaneContacts {
  hn::Mask<D> hit;  ///< the lanes with a contact; the other fields have no meaning in the other lanes
  hn::Vec<D> depth;
  Vector<D> normal;  ///< unit, from the first body to the second, world axes
  Vector<D> point;   ///< relative to the first body's position, world axes
};

/// The contact of two rounded shapes whose cores have known nearest points. A rounded shape is all points within a
/// radius of its core: a capsule is a segment with a radius.
///
/// `gap` is the vector from `first_nearest`, the nearest point of the first core, to that of the second core.
/// `direction_if_none`, of any length above zero, is the direction of the normal where the cores intersect. If it is
/// perpendicular to every segment among the cores, the depth there is the exact least depth.
template <class D>
HWY_INLINE LaneContacts<D> rounded_contact(D d, const Vector<D>& gap, hn::Vec<D> first_radius, hn::Vec<D> second_radius,
                                           const Vector<D>& first_nearest, const Vector<D>& direction_if_none) {
  const auto squared = dot(d, gap, gap);
  const auto meet = squared < no_length(d);
  const Vector<D> along = choose(d, meet, direction_if_none, gap);
  const auto length = hn::Sqrt(hn::IfThenElse(meet, dot(d, direction_if_none, direction_if_none), squared));
  const Vector<D> normal = scale(d, along, hn::Set(d, Scalar<D>{1}) / length);
  const auto depth = first_radius + second_radius - hn::IfThenZeroElse(meet, length);
  const auto to_middle = first_radius - depth * hn::Set(d, Scalar<D>(0.5));
  return {depth >= hn::Zero(d), depth, normal, add(d, first_nearest, scale(d, normal, to_middle))};
}

}  // namespace ringfence::narrow_phase::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#endif
