// Shared by the two kernels whose first shape is a box: the search for the axis of least overlap, and the contact
// point. Included once for each Highway target.

#if defined(RINGFENCE_NARROW_PHASE_BOX_INL) == defined(HWY_TARGET_TOGGLE)
#ifdef RINGFENCE_NARROW_PHASE_BOX_INL
#undef RINGFENCE_NARROW_PHASE_BOX_INL
#else
#define RINGFENCE_NARROW_PHASE_BOX_INL
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

/// The axis of least overlap so far among the cross products of box edge i and segment j. The product is not
/// normalised: overlap and length are stored as squares, so that an axis needs neither root nor division.
template <class D>
struct EdgeAxis {
  hn::Vec<D> overlap_squared, length_squared;
  hn::Vec<D> box_edge,
      other_edge;         ///< i and j as floating-point numbers; -1 where no product overlaps less than a face axis
  hn::Mask<D> separated;  ///< some axis separates the two
};

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

/// Which components of a unit normal count as zero (flat): those up to `from` do, those from `to` on do not.
template <class D>
struct Flatness {
  Scalar<D> from, to;
};

/// Which end of a segment is farthest along a direction: -1 or 1 for an end, 0 if the segment is perpendicular to the
/// direction (flat), in between for the transition.
template <class D>
HWY_INLINE hn::Vec<D> lean(D d, hn::Vec<D> component_of_normal, hn::Mask<D> sharp, Flatness<D> flat) {
  const auto one = hn::Set(d, Scalar<D>{1});
  const auto beyond = hn::Max(hn::Abs(component_of_normal) - hn::Set(d, flat.from), hn::Zero(d));
  const auto share = hn::Min(beyond * hn::Set(d, Scalar<D>{1} / (flat.to - flat.from)), one);
  return hn::IfThenElse(sharp, one, share) * sign_of(d, component_of_normal);
}

/// The features (corner, edge or face) of both shapes that are farthest along a direction, each given by its centre and
/// its half extent along each axis of the shape.
template <class D, int axes>
struct Features {
  Vector<D> box_base, box_free;
  Vector<D> other_base;
  hn::Vec<D> other_free[axes];
};

/// In `sharp` lanes: the two edges of the crossing. In other lanes: everything that is flat.
template <class D, int axes>
HWY_INLINE Features<D, axes> features_of(D d, const Vector<D>& box_half, const Zonotope<D, axes>& other,
                                         const Vector<D>& normal, hn::Mask<D> sharp, const Crossing<D, axes>& crossing,
                                         Flatness<D> flat) {
  const auto one = hn::Set(d, Scalar<D>{1});
  const auto& on = crossing.is_box_edge;
  const Vector<D> leans{hn::IfThenZeroElse(hn::And(sharp, on[0]), lean(d, normal.x, sharp, flat)),
                        hn::IfThenZeroElse(hn::And(sharp, on[1]), lean(d, normal.y, sharp, flat)),
                        hn::IfThenZeroElse(hn::And(sharp, on[2]), lean(d, normal.z, sharp, flat))};
  Features<D, axes> out;
  out.box_base = {leans.x * box_half.x, leans.y * box_half.y, leans.z * box_half.z};
  out.box_free = {box_half.x * (one - hn::Abs(leans.x)), box_half.y * (one - hn::Abs(leans.y)),
                  box_half.z * (one - hn::Abs(leans.z))};
  out.other_base = other.centre;
  for (int k = 0; k < axes; ++k) {
    const auto leaning = hn::IfThenZeroElse(hn::And(sharp, crossing.is_other_edge[k]),
                                            lean(d, dot(d, normal, other.axis[k]), sharp, flat));
    out.other_base = subtract(d, out.other_base, scale(d, other.axis[k], leaning * other.half[k]));
    out.other_free[k] = other.half[k] * (one - hn::Abs(leaning));
  }
  return out;
}

/// A point of each shape, as close to each other as was found.
template <class D>
struct PointPair {
  Vector<D> on_box, on_other;

  /// Whether the two points, projected along the unit normal, are farther apart than `near`.
  HWY_INLINE hn::Mask<D> farther_apart_than(D d, const Vector<D>& normal, hn::Vec<D> near) const {
    // Not computed as the difference of the squares of two lengths: for deep contacts its rounding error exceeds
    // `near`.
    const Vector<D> between = subtract(d, on_box, on_other);
    const Vector<D> across = subtract(d, between, scale(d, normal, dot(d, between, normal)));
    return dot(d, across, across) > near * near;
  }
};

/// The nearest points of two crossing lines, clamped to the edges. `inverse_squared` is one over the squared length of
/// their cross product.
template <class D, int axes>
HWY_INLINE PointPair<D> nearest_edge_points(D d, const Features<D, axes>& features, const Crossing<D, axes>& crossing,
                                            hn::Vec<D> inverse_squared) {
  const Vector<D> gap = subtract(d, features.other_base, features.box_base);
  const Vector<D> gap_by_edge = cross(d, gap, crossing.other_edge);
  auto s = limited(d, dot(d, gap_by_edge, crossing.product) * inverse_squared, crossing.box_half);
  const Vector<D> to_box = subtract(d, scale(d, crossing.box_edge, s), gap);
  const auto t = limited(d, dot(d, crossing.other_edge, to_box), crossing.other_half);
  const Vector<D> to_other = add(d, gap, scale(d, crossing.other_edge, t));
  s = limited(d, dot(d, crossing.box_edge, to_other), crossing.box_half);
  return {add(d, features.box_base, scale(d, crossing.box_edge, s)),
          add(d, features.other_base, scale(d, crossing.other_edge, t))};
}

/// A common point of the two features, projected along the normal, found by alternating projections from `start`.
/// Features that share only a corner converge slowly (about one pair in ten thousand). A lane that has converged, or is
/// not `wanted`, keeps its bits, so that its result does not depend on other lanes.
template <class D, int axes>
HWY_INLINE PointPair<D> common_feature_points(D d, const Features<D, axes>& features, const Zonotope<D, axes>& other,
                                              const Vector<D>& normal, hn::Vec<D> near, hn::Mask<D> wanted,
                                              const PointPair<D>& start) {
  const auto project_on_box = [&](const Vector<D>& v) {
    return Vector<D>{features.box_base.x + limited(d, v.x - features.box_base.x, features.box_free.x),
                     features.box_base.y + limited(d, v.y - features.box_base.y, features.box_free.y),
                     features.box_base.z + limited(d, v.z - features.box_base.z, features.box_free.z)};
  };
  const auto project_on_other = [&](const Vector<D>& v) {
    const Vector<D> from_base = subtract(d, v, features.other_base);
    Vector<D> out = features.other_base;
    for (int k = 0; k < axes; ++k) {
      const auto along = limited(d, dot(d, other.axis[k], from_base), features.other_free[k]);
      out = add(d, out, scale(d, other.axis[k], along));
    }
    return out;
  };
  PointPair<D> meeting = start;
  auto open = wanted;
  for (int round = 0; round < 64 && !hn::AllFalse(d, open); ++round) {
    const Vector<D> next = project_on_other(meeting.on_box);
    meeting.on_other = choose(d, open, next, meeting.on_other);
    meeting.on_box = choose(d, open, project_on_box(next), meeting.on_box);
    open = hn::And(open, meeting.farther_apart_than(d, normal, near));
  }
  return meeting;
}

/// The contact point in the frame of the box, for the unit `normal` out of the box and `depth`.
///
/// In `by_edge` lanes two edges cross, and the point lies between their nearest points. In other lanes, and where the
/// edges turn out not to meet, it is a common point of the flat features. If these do not meet either, rounding has
/// selected one of several almost equal axes, and the deepest place is near, on features that are less flat. Finally
/// the point is moved along the normal to midway between the two surfaces. `inverse_squared` is one over the squared
/// length of the edges' cross product. Lanes that are not `wanted` get an arbitrary point: features of shapes that are
/// apart never meet, and would delay the other lanes.
template <class D, int axes>
HWY_INLINE Vector<D> contact_point(D d, const Vector<D>& box_half, const Zonotope<D, axes>& other,
                                   const Vector<D>& normal, hn::Vec<D> depth, hn::Mask<D> by_edge,
                                   const Crossing<D, axes>& crossing, hn::Vec<D> inverse_squared, hn::Mask<D> wanted) {
  const auto box_size = box_half.x + box_half.y + box_half.z;
  auto other_size = other.half[0];
  for (int k = 1; k < axes; ++k) other_size = other_size + other.half[k];
  // Well within the permitted error of a point, and above the rounding error.
  const auto near = hn::Set(d, Scalar<D>(2e-5)) * hn::Min(box_size, other_size) +
                    hn::Set(d, Scalar<D>(1e-6)) * (box_size + other_size);

  // `rounding`: flat except for rounding. `misled`: as far from flat as a slightly worse axis can be. This is the
  // margin of face axes divided by the distance at which it matters, so the depth there is only slightly less.
  const Flatness<D> rounding{Scalar<D>(5e-5), Scalar<D>(1e-4)}, misled{Scalar<D>(4e-2), Scalar<D>(5e-2)};
  const auto none = hn::MaskFromVec(hn::Zero(d));

  const PointPair<D> crossed = nearest_edge_points(
      d, features_of(d, box_half, other, normal, by_edge, crossing, rounding), crossing, inverse_squared);
  const auto at_edges = hn::AndNot(crossed.farther_apart_than(d, normal, near), by_edge);
  const Features<D, axes> flat = features_of(d, box_half, other, normal, none, crossing, rounding);
  const auto by_faces = hn::AndNot(at_edges, wanted);
  PointPair<D> common = common_feature_points(d, flat, other, normal, near, by_faces, {flat.box_base, flat.other_base});
  const auto missed = hn::And(by_faces, common.farther_apart_than(d, normal, near));
  if (!hn::AllFalse(d, missed)) {
    common = common_feature_points(d, features_of(d, box_half, other, normal, none, crossing, misled), other, normal,
                                   near, missed, common);
  }
  const Vector<D> on_box = choose(d, at_edges, crossed.on_box, common.on_box);
  const Vector<D> on_other = choose(d, at_edges, crossed.on_other, common.on_other);

  const auto half = hn::Set(d, Scalar<D>(0.5));
  const Vector<D> middle = scale(d, add(d, on_box, on_other), half);
  const auto surface = hn::Abs(normal.x) * box_half.x + hn::Abs(normal.y) * box_half.y + hn::Abs(normal.z) * box_half.z;
  const auto shift = surface - depth * half - dot(d, normal, middle);
  return add(d, middle, scale(d, normal, shift));
}

}  // namespace ringfence::narrow_phase::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#endif
