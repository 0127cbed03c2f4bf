#include "narrow_phase/kernel.hpp"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "narrow_phase/primitives/box_box_kernel.cpp"
#include <hwy/foreach_target.h>
// After foreach_target.h.
#include "narrow_phase/primitives/box_axes-inl.hpp"
#include "narrow_phase/primitives/box_contact_point-inl.hpp"
#include "narrow_phase/simd/pair_block-inl.hpp"

HWY_BEFORE_NAMESPACE();
namespace ringfence::narrow_phase::HWY_NAMESPACE {

/// The separating axis test over all 15 axes. The Minkowski difference of two boxes is a polytope whose faces have
/// these normals, so the least overlap is the exact least translation over all directions.
struct BoxBox {
  static constexpr ShapeKind first = ShapeKind::box, second = ShapeKind::box;

  /// False if the normal of a face separates the two by more than rounding errors, as it does for most pairs that do
  /// not touch. With quaternions instead of matrices it takes fewer operations than the axes in `test`.
  template <class D>
  static HWY_INLINE hn::Mask<D> may_touch(D d, const Lanes<D>& in) {
    const Rotation<D> turn = rotation(d, relative(d, in.first_orientation, in.second_orientation));
    const Frame<D> boxes{in.first_size,   in.second_size,  unrotate(d, in.first_orientation, in.offset),
                         column(turn, 0), column(turn, 1), column(turn, 2)};
    return hn::Not(face_axis(d, boxes).overlap + filter_margin(d, size_of(boxes)) < hn::Zero(d));
  }

  template <class D>
  static HWY_INLINE LaneContacts<D> test(D d, const Lanes<D>& in) {
    const auto zero = hn::Zero(d);
    const Rotation<D> a = rotation(d, in.first_orientation);
    const Frame<D> boxes = frame_of(d, in, a);
    const auto& [p, q, t, u, v, w] = boxes;
    const FaceAxis<D> face = face_axis(d, boxes);

    EdgeAxis<D> edge = edge_axis_from(d, face.overlap, size_of(boxes));
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
  /// Both boxes in the frame of the first.
  template <class D>
  struct Frame {
    Vector<D> first_half, second_half;
    Vector<D> centre;   ///< of the second box
    Vector<D> u, v, w;  ///< the axes of the second box
  };

  /// `a` is the rotation of the first box.
  template <class D>
  static HWY_INLINE Frame<D> frame_of(D d, const Lanes<D>& in, const Rotation<D>& a) {
    const Rotation<D> b = rotation(d, in.second_orientation);
    return {in.first_size,
            in.second_size,
            unrotate(d, a, in.offset),
            unrotate(d, a, column(b, 0)),
            unrotate(d, a, column(b, 1)),
            unrotate(d, a, column(b, 2))};
  }

  template <class D>
  static HWY_INLINE hn::Vec<D> size_of(const Frame<D>& boxes) {
    const auto& [p, q, t, u, v, w] = boxes;
    return p.x + p.y + p.z + q.x + q.y + q.z;
  }

  template <class D>
  static HWY_INLINE FaceAxis<D> face_axis(D d, const Frame<D>& boxes) {
    const auto& [p, q, t, u, v, w] = boxes;
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
    return face;
  }

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

PairContact* box_box(const KernelInput& input, PairContact* out, KindCounters& counters) {
  return run<BoxBox>(input, out, counters);
}

}  // namespace ringfence::narrow_phase::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace ringfence::narrow_phase {

HWY_EXPORT(box_box);

PairContact* test_box_box(const KernelInput& input, PairContact* out, KindCounters& counters) {
  return HWY_DYNAMIC_DISPATCH(box_box)(input, out, counters);
}

}  // namespace ringfence::narrow_phase
#endif
