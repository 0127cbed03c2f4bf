#include "narrow_phase/kernel.hpp"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "narrow_phase/primitives/box_capsule_kernel.cpp"
#include <hwy/foreach_target.h>
// After foreach_target.h.
#include "narrow_phase/primitives/box_axes-inl.hpp"
#include "narrow_phase/primitives/box_contact_point-inl.hpp"
#include "narrow_phase/simd/pair_block-inl.hpp"

HWY_BEFORE_NAMESPACE();
namespace ringfence::narrow_phase::HWY_NAMESPACE {

/// The capsule's core against the box. If they are apart, the least distance of segment and box decides. It is the
/// minimum over the segment of a convex function, which is quadratic between the at most six points where the segment
/// crosses a face plane. If they overlap, the least overlap over the six axes of the box swept along the segment, plus
/// the radius, decides.
struct BoxCapsule {
  static constexpr ShapeKind first = ShapeKind::box, second = ShapeKind::capsule;

  /// False if the normal of a face separates the two by more than rounding errors, as it does for most pairs that do
  /// not touch.
  template <class D>
  static HWY_INLINE hn::Mask<D> may_touch(D d, const Lanes<D>& in) {
    const Frame<D> frame = frame_of(d, in, rotation(d, in.first_orientation));
    const auto margin = filter_margin(d, size_of(frame) + frame.radius);
    return hn::Not(face_axis(d, frame).overlap + frame.radius + margin < hn::Zero(d));
  }

  template <class D>
  static HWY_INLINE LaneContacts<D> test(D d, const Lanes<D>& in) {
    const auto zero = hn::Zero(d);
    const Rotation<D> box = rotation(d, in.first_orientation);
    const Frame<D> frame = frame_of(d, in, box);
    const auto rounding = hn::Set(d, sizeof(Scalar<D>) == 8 ? Scalar<D>(1e-14) : Scalar<D>(4e-6)) * size_of(frame);
    const Nearest<D> nearest = nearest_on_segment(d, frame.half, frame.centre, frame.u, frame.segment, rounding);
    const auto distance_squared = dot(d, nearest.gap, nearest.gap);
    // For a gap so small that rounding decides its direction the axes are used, which are as good there.
    const auto apart = distance_squared > rounding * rounding;

    const auto distance = hn::Sqrt(distance_squared);
    auto depth = frame.radius - distance;
    Vector<D> normal = scale(d, nearest.gap, hn::Set(d, Scalar<D>{1}) / distance);
    const auto along = frame.radius - depth * hn::Set(d, Scalar<D>(0.5));
    Vector<D> point = subtract(d, nearest.on_segment, scale(d, normal, along));
    if (!hn::AllTrue(d, apart)) {
      const LaneContacts<D> overlap = overlapping(d, frame, hn::Not(apart));
      depth = hn::IfThenElse(apart, depth, overlap.depth);
      normal = choose(d, apart, normal, overlap.normal);
      point = choose(d, apart, point, overlap.point);
    }
    return {depth >= zero, depth, rotate(d, box, normal), rotate(d, box, point)};
  }

 private:
  /// Box and capsule in the frame of the box.
  template <class D>
  struct Frame {
    Vector<D> half;              ///< of the box
    Vector<D> centre, u;         ///< the capsule's centre and its axis, a unit vector
    hn::Vec<D> segment, radius;  ///< the capsule's half length, without the ends, and its radius
  };

  /// `box` is the rotation of the box.
  template <class D>
  static HWY_INLINE Frame<D> frame_of(D d, const Lanes<D>& in, const Rotation<D>& box) {
    return {in.first_size, unrotate(d, box, in.offset), unrotate(d, box, z_axis(d, in.second_orientation)),
            in.second_size.y, in.second_size.x};
  }

  template <class D>
  static HWY_INLINE hn::Vec<D> size_of(const Frame<D>& frame) {
    return frame.half.x + frame.half.y + frame.half.z + frame.segment;
  }

  template <class D>
  static HWY_INLINE FaceAxis<D> face_axis(D d, const Frame<D>& frame) {
    const auto& [half, centre, u, segment, radius] = frame;
    FaceAxis<D> face;
    face.overlap = half.x + segment * hn::Abs(u.x) - hn::Abs(centre.x);
    face.normal = unit(d, 0);
    try_face_axis(d, half.y + segment * hn::Abs(u.y) - hn::Abs(centre.y), unit(d, 1), face);
    try_face_axis(d, half.z + segment * hn::Abs(u.z) - hn::Abs(centre.z), unit(d, 2), face);
    return face;
  }

  /// The contacts of the `wanted` lanes, in which core and box overlap; in the frame of the box.
  template <class D>
  static HWY_INLINE LaneContacts<D> overlapping(D d, const Frame<D>& frame, hn::Mask<D> wanted) {
    const auto zero = hn::Zero(d);
    const auto& [half, centre, u, segment, radius] = frame;
    const FaceAxis<D> face = face_axis(d, frame);
    EdgeAxis<D> edge = edge_axis_from(d, face.overlap, size_of(frame));
    try_edge_axis<0, 0>(d, half, centre, u, zero, edge);
    try_edge_axis<1, 0>(d, half, centre, u, zero, edge);
    try_edge_axis<2, 0>(d, half, centre, u, zero, edge);
    const Zonotope<D, 1> other{centre, {u}, {segment}};
    const Crossing<D, 1> crossing = crossing_of(d, edge, half, other);
    const auto by_edge = edge.box_edge >= zero;
    const auto inverse = hn::Set(d, Scalar<D>{1}) / hn::Sqrt(edge.length_squared);
    const auto overlap = hn::IfThenElse(by_edge, hn::Sqrt(edge.overlap_squared) * inverse, face.overlap);
    const auto depth = radius + overlap;
    const Vector<D> normal = towards(d, choose(d, by_edge, scale(d, crossing.product, inverse), face.normal), centre);
    const auto hit = hn::And(wanted, depth >= zero);
    const Vector<D> point = contact_point(d, half, other, normal, depth, by_edge, crossing, inverse * inverse, hit);
    return {hit, depth, normal, point};
  }

  template <class D>
  struct Nearest {
    Vector<D> on_segment;
    Vector<D> gap;  ///< from the box to the point on the segment; zero inside the box
  };

  /// Half the derivative of the squared distance to the box at t.
  template <class D>
  static HWY_INLINE hn::Vec<D> slope(D d, const Vector<D>& half, const Vector<D>& centre, const Vector<D>& u,
                                     hn::Vec<D> t) {
    return u.x * excess(d, centre.x + u.x * t, half.x) + u.y * excess(d, centre.y + u.y * t, half.y) +
           u.z * excess(d, centre.z + u.z * t, half.z);
  }

  /// A bracket of the root of the slope, which does not decrease along the segment.
  template <class D>
  struct Bracket {
    hn::Vec<D> low, low_slope, high, high_slope;
  };

  template <class D>
  static HWY_INLINE void narrow(D d, const Vector<D>& half, const Vector<D>& centre, const Vector<D>& u, hn::Vec<D> t,
                                Bracket<D>& bracket) {
    const auto at = slope(d, half, centre, u, t);
    const auto falls = at <= hn::Zero(d);
    const auto raises = hn::And(falls, t > bracket.low);
    const auto lowers = hn::AndNot(falls, t < bracket.high);
    bracket.low = hn::IfThenElse(raises, t, bracket.low);
    bracket.low_slope = hn::IfThenElse(raises, at, bracket.low_slope);
    bracket.high = hn::IfThenElse(lowers, t, bracket.high);
    bracket.high_slope = hn::IfThenElse(lowers, at, bracket.high_slope);
  }

  template <int i, class D>
  static HWY_INLINE void narrow_at_faces(D d, const Vector<D>& half, const Vector<D>& centre, const Vector<D>& u,
                                         hn::Vec<D> segment, Bracket<D>& bracket) {
    const auto one = hn::Set(d, Scalar<D>{1});
    const auto along = component<i, D>(u), at = component<i, D>(centre), face = component<i, D>(half);
    const auto passes = hn::Abs(along) > hn::Set(d, sizeof(Scalar<D>) == 8 ? Scalar<D>(1e-20) : Scalar<D>(1e-10));
    const auto inverse = hn::IfThenElseZero(passes, one / hn::IfThenElse(passes, along, one));
    narrow(d, half, centre, u, limited(d, (hn::Neg(face) - at) * inverse, segment), bracket);
    narrow(d, half, centre, u, limited(d, (face - at) * inverse, segment), bracket);
  }

  template <class D>
  static HWY_INLINE Nearest<D> nearest_on_segment(D d, const Vector<D>& half, const Vector<D>& centre,
                                                  const Vector<D>& u, hn::Vec<D> segment, hn::Vec<D> rounding) {
    const auto zero = hn::Zero(d), one = hn::Set(d, Scalar<D>{1});
    Bracket<D> bracket;
    bracket.low = hn::Neg(segment);
    bracket.low_slope = slope(d, half, centre, u, bracket.low);
    bracket.high = segment;
    bracket.high_slope = slope(d, half, centre, u, bracket.high);
    const auto at_low = bracket.low_slope >= zero;
    const auto at_high = bracket.high_slope <= zero;
    narrow_at_faces<0>(d, half, centre, u, segment, bracket);
    narrow_at_faces<1>(d, half, centre, u, segment, bracket);
    narrow_at_faces<2>(d, half, centre, u, segment, bracket);
    const auto rise = bracket.high_slope - bracket.low_slope;
    const auto rises = rise > zero;
    const auto share = hn::IfThenElseZero(rises, (zero - bracket.low_slope) / hn::IfThenElse(rises, rise, one));
    auto t = bracket.low + (bracket.high - bracket.low) * share;
    t = hn::IfThenElse(at_low, hn::Neg(segment), hn::IfThenElse(at_high, segment, t));

    const Vector<D> on_segment = add(d, centre, scale(d, u, t));
    Vector<D> gap{excess(d, on_segment.x, half.x), excess(d, on_segment.y, half.y), excess(d, on_segment.z, half.z)};
    // Inside the segment the gap is perpendicular to it, in the components in which it may change: a remainder from
    // rounding would tilt a short gap. Past a single face it may not change at all. What is longer is no remainder: the
    // point is past one more face, by less than rounding shows.
    const Vector<D> turns{hn::IfThenElseZero(gap.x != zero, u.x), hn::IfThenElseZero(gap.y != zero, u.y),
                          hn::IfThenElseZero(gap.z != zero, u.z)};
    const auto past_x = hn::IfThenElseZero(gap.x != zero, one), past_y = hn::IfThenElseZero(gap.y != zero, one),
               past_z = hn::IfThenElseZero(gap.z != zero, one);
    const auto squared = dot(d, turns, turns);
    const auto within = hn::AndNot(hn::Or(at_low, at_high), past_x + past_y + past_z > one);
    const auto remainder = dot(d, gap, turns);
    const auto is_short = remainder * remainder <= rounding * rounding * squared;
    const auto corrects = hn::And(hn::And(within, is_short), squared > least_edge_axis_squared(d));
    const auto tilt = hn::IfThenElseZero(corrects, remainder / hn::IfThenElse(corrects, squared, one));
    gap = subtract(d, gap, scale(d, turns, tilt));
    return {on_segment, gap};
  }
};

PairContact* box_capsule(const KernelInput& input, PairContact* out, KindCounters& counters) {
  return run<BoxCapsule>(input, out, counters);
}

}  // namespace ringfence::narrow_phase::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace ringfence::narrow_phase {

HWY_EXPORT(box_capsule);

PairContact* test_box_capsule(const KernelInput& input, PairContact* out, KindCounters& counters) {
  return HWY_DYNAMIC_DISPATCH(box_capsule)(input, out, counters);
}

}  // namespace ringfence::narrow_phase
#endif
