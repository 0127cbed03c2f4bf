#include "narrow_phase/kernel.hpp"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "narrow_phase/primitives/sphere_kernels.cpp"
#include <hwy/foreach_target.h>
// After foreach_target.h.
#include "narrow_phase/simd/pair_block-inl.hpp"

HWY_BEFORE_NAMESPACE();
namespace ringfence::narrow_phase::HWY_NAMESPACE {

struct SphereSphere {
  static constexpr ShapeKind first = ShapeKind::sphere, second = ShapeKind::sphere;

  template <class D>
  static HWY_INLINE LaneContacts<D> test(D d, const Lanes<D>& in) {
    const auto zero = hn::Zero(d);
    const Vector<D> up{zero, zero, hn::Set(d, Scalar<D>{1})};
    return rounded_contact(d, in.offset, in.first_size.x, in.second_size.x, Vector<D>{zero, zero, zero}, up);
  }
};

struct SphereCapsule {
  static constexpr ShapeKind first = ShapeKind::sphere, second = ShapeKind::capsule;

  template <class D>
  static HWY_INLINE LaneContacts<D> test(D d, const Lanes<D>& in) {
    const auto zero = hn::Zero(d);
    const Vector<D> axis = z_axis(d, in.second_orientation);
    const auto along = dot(d, in.offset, axis);
    Vector<D> across = subtract(d, in.offset, scale(d, axis, along));
    // A second pass: where the centre lies almost on the axis, the remainder of the first pass along the axis would
    // tilt the normal.
    across = subtract(d, across, scale(d, axis, dot(d, across, axis)));
    const Vector<D> gap = add(d, across, scale(d, axis, excess(d, along, in.second_size.y)));
    return rounded_contact(d, gap, in.first_size.x, in.second_size.x, Vector<D>{zero, zero, zero},
                           perpendicular(d, axis));
  }
};

struct SphereBox {
  static constexpr ShapeKind first = ShapeKind::sphere, second = ShapeKind::box;

  template <class D>
  static HWY_INLINE LaneContacts<D> test(D d, const Lanes<D>& in) {
    const auto zero = hn::Zero(d);
    const Rotation<D> box = rotation(d, in.second_orientation);
    const Vector<D>& half = in.second_size;
    const Vector<D> centre = negate(d, unrotate(d, box, in.offset));
    const Vector<D> out{excess(d, centre.x, half.x), excess(d, centre.y, half.y), excess(d, centre.z, half.z)};

    // The centre is inside the box: the normal is that of the nearest face.
    const auto to_x = half.x - hn::Abs(centre.x), to_y = half.y - hn::Abs(centre.y), to_z = half.z - hn::Abs(centre.z);
    const auto by_y = to_y < to_x;
    const auto to_xy = hn::IfThenElse(by_y, to_y, to_x);
    const auto by_z = to_z < to_xy;
    const auto to_face = hn::IfThenElse(by_z, to_z, to_xy);
    const Vector<D> face{hn::IfThenZeroElse(hn::Or(by_y, by_z), sign_of(d, centre.x)),
                         hn::IfThenElseZero(hn::AndNot(by_z, by_y), sign_of(d, centre.y)),
                         hn::IfThenElseZero(by_z, sign_of(d, centre.z))};

    const auto squared = dot(d, out, out);
    const auto inside = squared < no_length(d);
    const auto one = hn::Set(d, Scalar<D>{1});
    const auto distance = hn::Sqrt(squared);
    const auto inverse = one / hn::IfThenElse(inside, one, distance);
    const Vector<D> normal = negate(d, rotate(d, box, choose(d, inside, face, scale(d, out, inverse))));
    const auto radius = in.first_size.x;
    const auto depth = radius + hn::IfThenElse(inside, to_face, zero - distance);
    const auto along = radius - depth * hn::Set(d, Scalar<D>(0.5));
    return {depth >= zero, depth, normal, scale(d, normal, along)};
  }
};

PairContact* sphere_sphere(const KernelInput& input, PairContact* out, KindCounters& counters) {
  return run<SphereSphere>(input, out, counters);
}
PairContact* sphere_box(const KernelInput& input, PairContact* out, KindCounters& counters) {
  return run<SphereBox>(input, out, counters);
}
PairContact* sphere_capsule(const KernelInput& input, PairContact* out, KindCounters& counters) {
  return run<SphereCapsule>(input, out, counters);
}

}  // namespace ringfence::narrow_phase::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace ringfence::narrow_phase {

HWY_EXPORT(sphere_sphere);
HWY_EXPORT(sphere_box);
HWY_EXPORT(sphere_capsule);

PairContact* test_sphere_sphere(const KernelInput& input, PairContact* out, KindCounters& counters) {
  return HWY_DYNAMIC_DISPATCH(sphere_sphere)(input, out, counters);
}
PairContact* test_sphere_box(const KernelInput& input, PairContact* out, KindCounters& counters) {
  return HWY_DYNAMIC_DISPATCH(sphere_box)(input, out, counters);
}
PairContact* test_sphere_capsule(const KernelInput& input, PairContact* out, KindCounters& counters) {
  return HWY_DYNAMIC_DISPATCH(sphere_capsule)(input, out, counters);
}

}  // namespace ringfence::narrow_phase
#endif
