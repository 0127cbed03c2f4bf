#include "narrow_phase/kernel.hpp"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "narrow_phase/primitives/capsule_kernels.cpp"
#include <hwy/foreach_target.h>
// After foreach_target.h.
#include "narrow_phase/simd/pair_block-inl.hpp"

HWY_BEFORE_NAMESPACE();
namespace ringfence::narrow_phase::HWY_NAMESPACE {

/// Two segments p(s) = s u and q(t) = offset + t v. Their difference is a parallelogram in the plane of u and v. The
/// least translation of the capsules moves the origin out of the set of points within both radii of it. In the frame
/// (u, side, up) this is the problem of a point and a parallelogram in a plane, and every component of the gap that has
/// to be zero is exactly zero. So the normal is also right where the segments cross, touch or are collinear.
struct CapsuleCapsule {
  static constexpr ShapeKind first = ShapeKind::capsule, second = ShapeKind::capsule;

  template <class D>
  static HWY_INLINE LaneContacts<D> test(D d, const Lanes<D>& in) {
    const auto zero = hn::Zero(d);
    const auto one = hn::Set(d, Scalar<D>{1});
    const auto p_half = in.first_size.y, q_half = in.second_size.y;
    const Vector<D> u = z_axis(d, in.first_orientation), v = z_axis(d, in.second_orientation);

    // `up` is perpendicular to both: exactly to u, and to v within rounding, also where the two are nearly parallel and
    // the direction of the cross product is imprecise.
    Vector<D> up = cross(d, u, v);
    up = subtract(d, up, scale(d, u, dot(d, up, u)));
    const auto up_squared = dot(d, up, up);
    const auto parallel = up_squared < hn::Set(d, sizeof(Scalar<D>) == 8 ? Scalar<D>(1e-28) : Scalar<D>(1e-12));
    const Vector<D> across = perpendicular(d, u);
    const auto length = hn::Sqrt(hn::IfThenElse(parallel, dot(d, across, across), up_squared));
    const auto inverse_length = one / length;
    up = scale(d, choose(d, parallel, across, up), inverse_length);
    const Vector<D> side = cross(d, up, u);

    // In this frame v = (c, s, 0), where s is the length of the cross product; zero only where the segments count as
    // parallel.
    const auto c = dot(d, u, v);
    const auto s = hn::IfThenZeroElse(parallel, length);
    const auto x = dot(d, in.offset, u), y = dot(d, in.offset, side), z = dot(d, in.offset, up);

    // The origin is outside, past the edge at an end of q: t is that end, s is free.
    const auto end_t = hn::Neg(hn::CopySign(q_half, y));
    const auto past_end = hn::Abs(y) - s * q_half;
    const auto end_x = x + c * end_t;
    const auto end_gap_x = excess(d, end_x, p_half), end_gap_y = hn::CopySign(past_end, y);
    const auto end_squared = end_gap_x * end_gap_x + end_gap_y * end_gap_y;

    // The origin is outside, past the edge at an end of p: s is that end, t is free. The edge runs along v.
    const auto skew = hn::IfThenElse(parallel, y * c, y * c - x * s);
    const auto tip_s = hn::Neg(hn::CopySign(p_half, skew));
    const auto past_tip = hn::Abs(skew) - s * p_half;
    const auto tip_x = x - tip_s;
    const auto tip_along = tip_x * c + y * s;
    const auto tip_t = zero - limited(d, tip_along, q_half);
    const auto tip_gap_along = tip_along + tip_t, tip_gap_across = hn::CopySign(past_tip, skew);
    const auto tip_gap_x = tip_gap_along * c - tip_gap_across * s;
    const auto tip_gap_y = tip_gap_along * s + tip_gap_across * c;
    const auto tip_squared = tip_gap_along * tip_gap_along + tip_gap_across * tip_gap_across;

    // Neither: the segments cross in the projection along `up`, or they are collinear.
    const auto inner_t = limited(d, hn::IfThenElse(parallel, zero - c * x, zero - y * inverse_length), q_half);
    const auto inner_gap_x = excess(d, x, p_half + hn::Abs(c) * q_half);

    // Past an edge and between its ends, no other part of the parallelogram is nearer. Only if this holds for neither
    // edge do the distances decide: squares that differ by rounding must not choose between an edge and its end.
    const auto end = past_end > zero, tip = past_tip > zero;
    const auto end_between = hn::And(end, hn::Abs(end_x) <= p_half);
    const auto tip_between = hn::And(tip, hn::Abs(tip_along) <= q_half);
    const auto tip_wins = hn::AndNot(end_between, hn::Or(tip_between, hn::And(tip, tip_squared < end_squared)));
    const auto by_end = hn::AndNot(tip_wins, end);
    const auto by_tip = hn::AndNot(by_end, tip);
    const auto gap_x = hn::IfThenElse(by_end, end_gap_x, hn::IfThenElse(by_tip, tip_gap_x, inner_gap_x));
    const auto gap_y = hn::IfThenElse(by_end, end_gap_y, hn::IfThenElseZero(by_tip, tip_gap_y));
    const auto t = hn::IfThenElse(by_end, end_t, hn::IfThenElse(by_tip, tip_t, inner_t));
    const auto p_nearest = hn::IfThenElse(by_tip, tip_s, limited(d, x + c * t, p_half));

    const Vector<D> gap = add(d, add(d, scale(d, u, gap_x), scale(d, side, gap_y)), scale(d, up, z));
    return rounded_contact(d, gap, in.first_size.x, in.second_size.x, scale(d, u, p_nearest), up);
  }
};

PairContact* capsule_capsule(const KernelInput& input, PairContact* out, KindCounters& counters) {
  return run<CapsuleCapsule>(input, out, counters);
}

}  // namespace ringfence::narrow_phase::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace ringfence::narrow_phase {

HWY_EXPORT(capsule_capsule);

PairContact* test_capsule_capsule(const KernelInput& input, PairContact* out, KindCounters& counters) {
  return HWY_DYNAMIC_DISPATCH(capsule_capsule)(input, out, counters);
}

}  // namespace ringfence::narrow_phase
#endif
