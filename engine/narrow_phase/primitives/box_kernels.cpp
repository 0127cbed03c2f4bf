#include "narrow_phase/kernel.hpp"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "narrow_phase/primitives/box_kernels.cpp"
#include <hwy/foreach_target.h>
// After foreach_target.h.
#include "narrow_phase/primitives/box-inl.hpp"
#include "narrow_phase/simd/pair_block-inl.hpp"

HWY_BEFORE_NAMESPACE();
namespace ringfence::narrow_phase::HWY_NAMESPACE {

/// The face axis of least overlap so far.
template <class D>
struct FaceAxis {
  hn::Vec<D> overlap;
  Vector<D> normal;
};

template <class D>
HWY_INLINE void try_face_axis(D d, hn::Vec<D> overlap, const Vector<D>& normal, FaceAxis<D>& best) {
  const auto less = overlap < best.overlap;
  best.overlap = hn::IfThenElse(less, overlap, best.overlap);
  best.normal = choose(d, less, normal, best.normal);
}

template <class D>
HWY_INLINE Vector<D> unit(D d, int i) {
  const auto zero = hn::Zero(d), one = hn::Set(d, Scalar<D>{1});
  return {i == 0 ? one : zero, i == 1 ? one : zero, i == 2 ? one : zero};
}

/// `normal` or its negative, whichever points towards `centre`; deterministic where both are perpendicular.
template <class D>
HWY_INLINE Vector<D> towards(D d, const Vector<D>& normal, const Vector<D>& centre) {
  return scale(d, normal, sign_of(d, dot(d, normal, centre)));
}

/// Starts the search over edge axes: an edge axis has to beat the best face axis by a margin of a few rounding errors
/// of `size`. Where both are equally good, the face is right: the deepest place lies on the face, and not on the edges
/// that happen to have the same direction.
template <class D>
HWY_INLINE EdgeAxis<D> edge_axis_from(D d, hn::Vec<D> face_overlap, hn::Vec<D> size) {
  const auto zero = hn::Zero(d), none = hn::Set(d, Scalar<D>{-1});
  const auto roundings = hn::Set(d, sizeof(Scalar<D>) == 8 ? Scalar<D>(1e-14) : Scalar<D>(1e-6));
  const auto least = hn::Max(face_overlap - roundings * size, zero);
  return {least * least, hn::Set(d, Scalar<D>{1}), none, none, face_overlap < zero};
}

/// The separating axis test over all 15 axes. The Minkowski difference of two boxes is a polytope whose faces have
/// these normals, so the least overlap is the exact least translation over all directions.
struct BoxBox {
  static constexpr ShapeKind first = ShapeKind::box, second = ShapeKind::box;

  template <class D>
  static HWY_INLINE LaneContacts<D> test(D d, const Lanes<D>& in) {
    const auto zero = hn::Zero(d);
    const Rotation<D> a = rotation(d, in.first_orientation), b = rotation(d, in.second_orientation);
    const Vector<D>&p = in.first_size, &q = in.second_size;
    const Vector<D> t = unrotate(d, a, in.offset);
    // The axes of the second box in the frame of the first.
    const Vector<D> u = unrotate(d, a, column(b, 0)), v = unrotate(d, a, column(b, 1)),
                    w = unrotate(d, a, column(b, 2));

    FaceAxis<D> face;
    face.overlap = p.x + q.x * hn::Abs(u.x) + q.y * hn::Abs(v.x) + q.z * hn::Abs(w.x) - hn::Abs(t.x);
    face.normal = unit(d, 0);
    try_face_axis(d, p.y + q.x * hn::Abs(u.y) + q.y * hn::Abs(v.y) + q.z * hn::Abs(w.y) - hn::Abs(t.y), unit(d, 1),
                  face);
    try_face_axis(d, p.z + q.x * hn::Abs(u.z) + q.y * hn::Abs(v.z) + q.z * hn::Abs(w.z) - hn::Abs(t.z), unit(d, 2),
                  face);
    try_face_axis(d, q.x + extent_along(p, u) - hn::Abs(dot(d, t, u)), u, face);
    try_face_axis(d, q.y + extent_along(p, v) - hn::Abs(dot(d, t, v)), v, face);
    try_face_axis(d, q.z + extent_along(p, w) - hn::Abs(dot(d, t, w)), w, face);

    EdgeAxis<D> edge = edge_axis_from(d, face.overlap, p.x + p.y + p.z + q.x + q.y + q.z);
    try_edges_along<0>(d, p, t, u, v, w, q, edge);
    try_edges_along<1>(d, p, t, u, v, w, q, edge);
    try_edges_along<2>(d, p, t, u, v, w, q, edge);

    const Zonotope<D, 3> other{t, {u, v, w}, {q.x, q.y, q.z}};
    const Crossing<D, 3> crossing = crossing_of(d, edge, p, other);
    const auto by_edge = edge.box_edge >= zero;
    const auto inverse = hn::Set(d, Scalar<D>{1}) / hn::Sqrt(edge.length_squared);
    const auto depth = hn::IfThenElse(by_edge, hn::Sqrt(edge.overlap_squared) * inverse, face.overlap);
    const Vector<D> normal = towards(d, choose(d, by_edge, scale(d, crossing.product, inverse), face.normal), t);
    const auto hit = hn::Not(edge.separated);
    const Vector<D> point = contact_point(d, p, other, normal, depth, by_edge, crossing, inverse * inverse, hit);
    return {hit, depth, rotate(d, a, normal), rotate(d, a, point)};
  }

 private:
  template <class V>
  static HWY_INLINE auto extent_along(const V& half, const V& axis) {
    return half.x * hn::Abs(axis.x) + half.y * hn::Abs(axis.y) + half.z * hn::Abs(axis.z);
  }

  /// Tests the cross products of e_i with each axis of the second box. The extent of the second box along a product e_i
  /// x u consists of (e_i x u) . v and (e_i x u) . w, which are minors of the relative rotation. They are computed as
  /// minors, not taken from the matrix entries that they equal in exact arithmetic: near parallel edges the difference
  /// between the two would matter.
  template <int i, class D>
  static HWY_INLINE void try_edges_along(D d, const Vector<D>& p, const Vector<D>& t, const Vector<D>& u,
                                         const Vector<D>& v, const Vector<D>& w, const Vector<D>& q,
                                         EdgeAxis<D>& best) {
    constexpr int j = (i + 1) % 3, k = (i + 2) % 3;
    const auto uv = hn::Abs(component<j, D>(u) * component<k, D>(v) - component<k, D>(u) * component<j, D>(v));
    const auto uw = hn::Abs(component<j, D>(u) * component<k, D>(w) - component<k, D>(u) * component<j, D>(w));
    const auto vw = hn::Abs(component<j, D>(v) * component<k, D>(w) - component<k, D>(v) * component<j, D>(w));
    try_edge_axis<i, 0>(d, p, t, u, q.y * uv + q.z * uw, best);
    try_edge_axis<i, 1>(d, p, t, v, q.x * uv + q.z * vw, best);
    try_edge_axis<i, 2>(d, p, t, w, q.x * uw + q.y * vw, best);
  }
};

/// The capsule's core against the box. If they are apart, the least distance of segment and box decides. It is the
/// minimum over the segment of a convex function, which is quadratic between the at most six points where the segment
/// crosses a face plane. If they overlap, the least overlap over the six axes of the box swept along the segment, plus
/// the radius, decides.
struct BoxCapsule {
  static constexpr ShapeKind first = ShapeKind::box, second = ShapeKind::capsule;

  template <class D>
  static HWY_INLINE LaneContacts<D> test(D d, const Lanes<D>& in) {
    const auto zero = hn::Zero(d), one = hn::Set(d, Scalar<D>{1});
    const Rotation<D> box = rotation(d, in.first_orientation);
    const Vector<D>& half = in.first_size;
    const auto radius = in.second_size.x, segment = in.second_size.y;
    const Vector<D> centre = unrotate(d, box, in.offset);
    const Vector<D> u = unrotate(d, box, z_axis(d, in.second_orientation));

    const Nearest<D> nearest = nearest_on_segment(d, half, centre, u, segment);
    const auto distance_squared = dot(d, nearest.gap, nearest.gap);

    FaceAxis<D> face;
    face.overlap = half.x + segment * hn::Abs(u.x) - hn::Abs(centre.x);
    face.normal = unit(d, 0);
    try_face_axis(d, half.y + segment * hn::Abs(u.y) - hn::Abs(centre.y), unit(d, 1), face);
    try_face_axis(d, half.z + segment * hn::Abs(u.z) - hn::Abs(centre.z), unit(d, 2), face);
    const auto size = half.x + half.y + half.z + segment;
    EdgeAxis<D> edge = edge_axis_from(d, face.overlap, size);
    try_edge_axis<0, 0>(d, half, centre, u, zero, edge);
    try_edge_axis<1, 0>(d, half, centre, u, zero, edge);
    try_edge_axis<2, 0>(d, half, centre, u, zero, edge);

    // For a gap so small that rounding decides its direction the axes are used, which are as good there.
    const auto rounding = hn::Set(d, sizeof(Scalar<D>) == 8 ? Scalar<D>(1e-14) : Scalar<D>(4e-6)) * size;
    const auto apart = distance_squared > rounding * rounding;
    const auto by_edge = hn::AndNot(apart, edge.box_edge >= zero);
    const Zonotope<D, 1> other{centre, {u}, {segment}};
    const Crossing<D, 1> crossing = crossing_of(d, edge, half, other);
    // The length of the vector that gives the normal: the gap, or the cross product of the two edges.
    const auto length = hn::Sqrt(hn::IfThenElse(apart, distance_squared, edge.length_squared));
    const auto inverse = one / length;
    const auto overlap = hn::IfThenElse(by_edge, hn::Sqrt(edge.overlap_squared) * inverse, face.overlap);
    const auto depth = radius + hn::IfThenElse(apart, zero - length, overlap);
    const Vector<D> axis = choose(d, by_edge, scale(d, crossing.product, inverse), face.normal);
    const Vector<D> normal = choose(d, apart, scale(d, nearest.gap, inverse), towards(d, axis, centre));

    const auto hit = depth >= zero;
    const Vector<D> overlap_point =
        contact_point(d, half, other, normal, depth, by_edge, crossing, inverse * inverse, hn::AndNot(apart, hit));
    const auto along = radius - depth * hn::Set(d, Scalar<D>(0.5));
    const Vector<D> near = subtract(d, nearest.on_segment, scale(d, normal, along));
    const Vector<D> point = choose(d, apart, near, overlap_point);
    return {hit, depth, rotate(d, box, normal), rotate(d, box, point)};
  }

 private:
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
                                                  const Vector<D>& u, hn::Vec<D> segment) {
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
    // rounding would tilt a short gap. Past a single face it may not change at all.
    const Vector<D> turns{hn::IfThenElseZero(gap.x != zero, u.x), hn::IfThenElseZero(gap.y != zero, u.y),
                          hn::IfThenElseZero(gap.z != zero, u.z)};
    const auto past_x = hn::IfThenElseZero(gap.x != zero, one), past_y = hn::IfThenElseZero(gap.y != zero, one),
               past_z = hn::IfThenElseZero(gap.z != zero, one);
    const auto squared = dot(d, turns, turns);
    const auto within = hn::AndNot(hn::Or(at_low, at_high), past_x + past_y + past_z > one);
    const auto corrects = hn::And(within, squared > least_edge_axis_squared(d));
    const auto tilt = hn::IfThenElseZero(corrects, dot(d, gap, turns) / hn::IfThenElse(corrects, squared, one));
    gap = subtract(d, gap, scale(d, turns, tilt));
    return {on_segment, gap};
  }
};

PairContact* box_box(const KernelInput& input, PairContact* out, KindCounters& counters) {
  return run<BoxBox>(input, out, counters);
}
PairContact* box_capsule(const KernelInput& input, PairContact* out, KindCounters& counters) {
  return run<BoxCapsule>(input, out, counters);
}

}  // namespace ringfence::narrow_phase::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace ringfence::narrow_phase {

HWY_EXPORT(box_box);
HWY_EXPORT(box_capsule);

PairContact* test_box_box(const KernelInput& input, PairContact* out, KindCounters& counters) {
  return HWY_DYNAMIC_DISPATCH(box_box)(input, out, counters);
}
PairContact* test_box_capsule(const KernelInput& input, PairContact* out, KindCounters& counters) {
  return HWY_DYNAMIC_DISPATCH(box_capsule)(input, out, counters);
}

}  // namespace ringfence::narrow_phase
#endif
