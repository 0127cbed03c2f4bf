// Shared by the kernels whose first shape is a box: the contact point. Included once for each Highway target.

#if defined(RINGFENCE_NARROW_PHASE_BOX_CONTACT_POINT_INL) == defined(HWY_TARGET_TOGGLE)
#ifdef RINGFENCE_NARROW_PHASE_BOX_CONTACT_POINT_INL
#undef RINGFENCE_NARROW_PHASE_BOX_CONTACT_POINT_INL
#else
#define RINGFENCE_NARROW_PHASE_BOX_CONTACT_POINT_INL
#endif

#include "narrow_phase/primitives/box_axes-inl.hpp"
#include "narrow_phase/simd/lanes-inl.hpp"

HWY_BEFORE_NAMESPACE();
namespace ringfence::narrow_phase::HWY_NAMESPACE {

/// Which components of a unit normal count as zero (flat): those up to `from` do, those from `to` on do not.
template <class D>
struct Flatness {
  Scalar<D> from, to;
};

/// How far the farthest point of a segment along a direction lies from the segment's centre: `share` of the half
/// length, 1 for an end, 0 if the segment is perpendicular to the direction (flat), in between for the transition.
/// `signed_share` has the sign of the end.
template <class D>
struct Lean {
  hn::Vec<D> share, signed_share;
};

/// `crossing` lanes: the segment is an edge that the direction is perpendicular to. Other `sharp` lanes: an end.
template <class D>
HWY_INLINE Lean<D> lean(D d, hn::Vec<D> component_of_normal, hn::Mask<D> sharp, hn::Mask<D> crossing,
                        Flatness<D> flat) {
  const auto one = hn::Set(d, Scalar<D>{1});
  const auto beyond = hn::Max(hn::Abs(component_of_normal) - hn::Set(d, flat.from), hn::Zero(d));
  const auto gradual = hn::Min(beyond * hn::Set(d, Scalar<D>{1} / (flat.to - flat.from)), one);
  const auto share = hn::IfThenZeroElse(hn::And(sharp, crossing), hn::IfThenElse(sharp, one, gradual));
  return {share, hn::CopySignToAbs(share, component_of_normal)};
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
  const Lean<D> x = lean(d, normal.x, sharp, on[0], flat), y = lean(d, normal.y, sharp, on[1], flat),
                z = lean(d, normal.z, sharp, on[2], flat);
  Features<D, axes> out;
  out.box_base = {x.signed_share * box_half.x, y.signed_share * box_half.y, z.signed_share * box_half.z};
  out.box_free = {box_half.x * (one - x.share), box_half.y * (one - y.share), box_half.z * (one - z.share)};
  out.other_base = other.centre;
  for (int k = 0; k < axes; ++k) {
    const Lean<D> along = lean(d, dot(d, normal, other.axis[k]), sharp, crossing.is_other_edge[k], flat);
    out.other_base = subtract(d, out.other_base, scale(d, other.axis[k], along.signed_share * other.half[k]));
    out.other_free[k] = other.half[k] * (one - along.share);
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

template <class D>
HWY_INLINE PointPair<D> choose(D d, hn::Mask<D> mask, const PointPair<D>& yes, const PointPair<D>& no) {
  return {choose(d, mask, yes.on_box, no.on_box), choose(d, mask, yes.on_other, no.on_other)};
}

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

/// The point of the other feature nearest to a point on the box, and the point of the box's feature nearest to that.
template <class D, int axes>
HWY_INLINE PointPair<D> project(D d, const Features<D, axes>& features, const Zonotope<D, axes>& other,
                                const Vector<D>& on_box) {
  const Vector<D> from_base = subtract(d, on_box, features.other_base);
  Vector<D> on_other = features.other_base;
  for (int k = 0; k < axes; ++k) {
    const auto along = limited(d, dot(d, other.axis[k], from_base), features.other_free[k]);
    on_other = add(d, on_other, scale(d, other.axis[k], along));
  }
  const Vector<D>&base = features.box_base, &free = features.box_free;
  return {{base.x + limited(d, on_other.x - base.x, free.x), base.y + limited(d, on_other.y - base.y, free.y),
           base.z + limited(d, on_other.z - base.z, free.z)},
          on_other};
}

/// Searches a common point of the two features, projected along the normal, by alternating projections from
/// `points.on_box`, in the lanes `open`. Features that share only a corner converge slowly (about one pair in ten
/// thousand). A lane that has converged keeps its bits, so that its result does not depend on other lanes. Returns the
/// lanes that have not converged after 64 rounds.
template <class D, int axes>
HWY_INLINE hn::Mask<D> search_common_points(D d, const Features<D, axes>& features, const Zonotope<D, axes>& other,
                                            const Vector<D>& normal, hn::Vec<D> near, hn::Mask<D> open,
                                            PointPair<D>& points) {
  for (int round = 0; round < 64 && !hn::AllFalse(d, open); ++round) {
    points = choose(d, open, project(d, features, other, points.on_box), points);
    open = hn::And(open, points.farther_apart_than(d, normal, near));
  }
  return open;
}

/// Flat except for rounding.
template <class D>
inline constexpr Flatness<D> rounding_flatness{Scalar<D>(5e-5), Scalar<D>(1e-4)};
/// As far from flat as a slightly worse axis can be: the margin of face axes divided by the distance at which it
/// matters, so the depth there is only slightly less.
template <class D>
inline constexpr Flatness<D> misled_flatness{Scalar<D>(4e-2), Scalar<D>(5e-2)};

/// Points of the flat features in the `open` lanes, in which one projection did not find a common point, or in which
/// the crossing edges do not meet. If the flat features do not meet either, rounding has selected one of several almost
/// equal axes, and the deepest place is near, on features that are less flat. Rare, so it is not inlined.
template <class D, int axes>
HWY_NOINLINE void search_flat_features(D d, const Vector<D>& box_half, const Zonotope<D, axes>& other,
                                       const Vector<D>& normal, const Crossing<D, axes>& crossing, hn::Vec<D> near,
                                       hn::Mask<D> open, PointPair<D>& points) {
  const auto none = hn::MaskFromVec(hn::Zero(d));
  const Features<D, axes> flat = features_of(d, box_half, other, normal, none, crossing, rounding_flatness<D>);
  points = choose(d, open, {flat.box_base, flat.other_base}, points);
  open = search_common_points(d, flat, other, normal, near, open, points);
  if (hn::AllFalse(d, open)) return;
  const Features<D, axes> less_flat = features_of(d, box_half, other, normal, none, crossing, misled_flatness<D>);
  search_common_points(d, less_flat, other, normal, near, open, points);
}

/// The contact point in the frame of the box, for the unit `normal` out of the box and `depth`.
///
/// In `by_edge` lanes two edges cross, and the point lies between their nearest points. In other lanes, and where the
/// edges turn out not to meet, it is a common point of the flat features. Finally the point is moved along the normal
/// to midway between the two surfaces. `inverse_squared` is one over the squared length of the edges' cross product.
/// Lanes that are not `wanted` get an arbitrary point: features of shapes that are apart never meet, and would delay
/// the other lanes.
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

  const Features<D, axes> features = features_of(d, box_half, other, normal, by_edge, crossing, rounding_flatness<D>);
  PointPair<D> points = choose(d, by_edge, nearest_edge_points(d, features, crossing, inverse_squared),
                               project(d, features, other, features.box_base));
  const auto open = hn::And(wanted, points.farther_apart_than(d, normal, near));
  if (!hn::AllFalse(d, open)) search_flat_features(d, box_half, other, normal, crossing, near, open, points);

  const auto half = hn::Set(d, Scalar<D>(0.5));
  const Vector<D> middle = scale(d, add(d, points.on_box, points.on_other), half);
  const auto surface = hn::Abs(normal.x) * box_half.x + hn::Abs(normal.y) * box_half.y + hn::Abs(normal.z) * box_half.z;
  const auto shift = surface - depth * half - dot(d, normal, middle);
  return add(d, middle, scale(d, normal, shift));
}

}  // namespace ringfence::narrow_phase::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#endif
