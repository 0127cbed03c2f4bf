// Shared by the kernels whose first shape is a box: the search for the axis of least overlap. Included once for each
// Highway target.

#if defined(RINGFENCE_NARROW_PHASE_BOX_AXES_INL) == defined(HWY_TARGET_TOGGLE)
#ifdef RINGFENCE_NARROW_PHASE_BOX_AXES_INL
#undef RINGFENCE_NARROW_PHASE_BOX_AXES_INL
#else
#define RINGFENCE_NARROW_PHASE_BOX_AXES_INL
#endif

#include "narrow_phase/simd/lanes-inl.hpp"

HWY_BEFORE_NAMESPACE();
namespace ringfence::narrow_phase::HWY_NAMESPACE {

/// The second shape as a sum of segments (a zonotope), in the frame of the box: each segment is `axis[k]` with half
/// length `half[k]`. Three orthogonal segments are a box, one is the core of a capsule.
template <class D, int axes>
struct Zonotope {
  Vector<D> centre;
  Vector<D> axis[axes];
  hn::Vec<D> half[axes];
};

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

/// The margin of a filter by face axes for shapes of this size, metres: above the rounding errors of the overlap, which
/// is computed in another way than in the test.
template <class D>
HWY_INLINE hn::Vec<D> filter_margin(D d, hn::Vec<D> size) {
  return hn::Set(d, Scalar<D>(1e-5)) * size;
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

/// The axis of least overlap so far among the cross products of box edge i and segment j. The product is not
/// normalised: overlap and length are stored as squares, so that an axis needs neither root nor division.
template <class D>
struct EdgeAxis {
  hn::Vec<D> overlap_squared, length_squared;
  hn::Vec<D> box_edge,
      other_edge;         ///< i and j as floating-point numbers; -1 where no product overlaps less than a face axis
  hn::Mask<D> separated;  ///< some axis separates the two
};

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

/// Shorter products are skipped: the edges are so nearly parallel that a face axis is as good, up to the same share of
/// the size.
template <class D>
HWY_INLINE hn::Vec<D> least_edge_axis_squared(D d) {
  return hn::Set(d, sizeof(Scalar<D>) == 8 ? Scalar<D>(1e-24) : Scalar<D>(1e-12));
}

template <int i, class D>
HWY_INLINE hn::Vec<D> component(const Vector<D>& v) {
  if constexpr (i == 0) return v.x;
  if constexpr (i == 1) return v.y;
  if constexpr (i == 2) return v.z;
}

/// Replaces `best` by e_i x axis j where that overlaps less; `edge` is axis j. `other_extent` is the second shape's
/// half extent along the product. It is computed from the same components as the product itself, so that its rounding
/// error scales with the length of the product.
template <int i, int j, class D>
HWY_INLINE void try_edge_axis(D d, const Vector<D>& box_half, const Vector<D>& centre, const Vector<D>& edge,
                              hn::Vec<D> other_extent, EdgeAxis<D>& best) {
  constexpr int k = (i + 1) % 3, m = (i + 2) % 3;
  const auto a = component<k, D>(edge), b = component<m, D>(edge);
  const auto length_squared = a * a + b * b;
  const auto extent = component<k, D>(box_half) * hn::Abs(b) + component<m, D>(box_half) * hn::Abs(a) + other_extent;
  const auto apart = component<m, D>(centre) * a - component<k, D>(centre) * b;
  const auto overlap = extent - hn::Abs(apart);
  const auto valid = length_squared > least_edge_axis_squared(d);
  best.separated = hn::Or(best.separated, hn::And(valid, overlap < hn::Zero(d)));
  const auto overlap_squared = overlap * overlap;
  const auto less = hn::And(valid, overlap_squared * best.length_squared < best.overlap_squared * length_squared);
  best.overlap_squared = hn::IfThenElse(less, overlap_squared, best.overlap_squared);
  best.length_squared = hn::IfThenElse(less, length_squared, best.length_squared);
  best.box_edge = hn::IfThenElse(less, hn::Set(d, Scalar<D>{i}), best.box_edge);
  best.other_edge = hn::IfThenElse(less, hn::Set(d, Scalar<D>{j}), best.other_edge);
}

/// The two edges whose cross product is the axis.
template <class D, int axes>
struct Crossing {
  hn::Mask<D> is_box_edge[3], is_other_edge[axes];
  Vector<D> box_edge, other_edge;   ///< unit; zero and arbitrary where the axis is a face normal
  hn::Vec<D> box_half, other_half;  ///< their half lengths
  Vector<D> product;
};

template <class D, int axes>
HWY_INLINE Crossing<D, axes> crossing_of(D d, const EdgeAxis<D>& axis, const Vector<D>& box_half,
                                         const Zonotope<D, axes>& other) {
  const auto one = hn::Set(d, Scalar<D>{1});
  Crossing<D, axes> out;
  for (int i = 0; i < 3; ++i) out.is_box_edge[i] = axis.box_edge == hn::Set(d, static_cast<Scalar<D>>(i));
  for (int j = 0; j < axes; ++j) out.is_other_edge[j] = axis.other_edge == hn::Set(d, static_cast<Scalar<D>>(j));
  out.box_edge = {hn::IfThenElseZero(out.is_box_edge[0], one), hn::IfThenElseZero(out.is_box_edge[1], one),
                  hn::IfThenElseZero(out.is_box_edge[2], one)};
  out.box_half =
      hn::IfThenElse(out.is_box_edge[0], box_half.x, hn::IfThenElse(out.is_box_edge[1], box_half.y, box_half.z));
  out.other_edge = other.axis[0];
  out.other_half = other.half[0];
  for (int j = 1; j < axes; ++j) {
    out.other_edge = choose(d, out.is_other_edge[j], other.axis[j], out.other_edge);
    out.other_half = hn::IfThenElse(out.is_other_edge[j], other.half[j], out.other_half);
  }
  out.product = cross(d, out.box_edge, out.other_edge);
  return out;
}

}  // namespace ringfence::narrow_phase::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#endif
