// What the two kernels with a box first share: the search for the axis of least overlap, and the point of contact.
// Included once for each Highway target.

#if defined(RINGFENCE_NARROW_PHASE_BOX_INL) == defined(HWY_TARGET_TOGGLE)
#ifdef RINGFENCE_NARROW_PHASE_BOX_INL
#undef RINGFENCE_NARROW_PHASE_BOX_INL
#else
#define RINGFENCE_NARROW_PHASE_BOX_INL
#endif

#include "narrow_phase/lanes-inl.hpp"

HWY_BEFORE_NAMESPACE();
namespace ringfence::narrow_phase::HWY_NAMESPACE {

/// The second body about a box, in the box's frame: a sum of segments, each `axis[k]` of half length `half[k]`.
/// Three orthogonal ones are a box, one is the core of a capsule.
template <class D, int axes>
struct Zonotope {
  Vector<D> centre;
  Vector<D> axis[axes];
  hn::Vec<D> half[axes];
};

/// The axis of least overlap so far among the cross products of box edge i and segment j, not normalised: overlap and
/// length are kept as squares, so that an axis costs neither root nor division.
template <class D>
struct EdgeAxis {
  hn::Vec<D> overlap_squared, length_squared;
  hn::Vec<D> box_edge, other_edge;  ///< i and j as numbers; -1 where no product overlaps less than a face axis
  hn::Mask<D> separated;            ///< some axis has no overlap
};

/// Products shorter than this are skipped: edges so parallel that the face axes are as good to within the same share
/// of the size.
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

/// Takes e_i x axis j for `best` where it overlaps less; `edge` is axis j. `other_extent` is the second body's half
/// extent along the product, computed from the same components as the product itself, so that rounding scales with its
/// length.
template <int i, int j, class D>
HWY_INLINE void try_edge_axis(D d, const Vector<D>& box_half, const Vector<D>& centre, const Vector<D>& edge,
                              hn::Vec<D> other_extent, EdgeAxis<D>& best) {
  constexpr int k = (i + 1) % 3, m = (i + 2) % 3;
  const auto a = component<k, D>(edge), b = component<m, D>(edge);
  const auto length_squared = a * a + b * b;
  const auto reach = component<k, D>(box_half) * hn::Abs(b) + component<m, D>(box_half) * hn::Abs(a) + other_extent;
  const auto apart = component<m, D>(centre) * a - component<k, D>(centre) * b;
  const auto overlap = reach - hn::Abs(apart);
  const auto valid = length_squared > least_edge_axis_squared(d);
  best.separated = hn::Or(best.separated, hn::And(valid, overlap < hn::Zero(d)));
  const auto overlap_squared = overlap * overlap;
  const auto less = hn::And(valid, overlap_squared * best.length_squared < best.overlap_squared * length_squared);
  best.overlap_squared = hn::IfThenElse(less, overlap_squared, best.overlap_squared);
  best.length_squared = hn::IfThenElse(less, length_squared, best.length_squared);
  best.box_edge = hn::IfThenElse(less, hn::Set(d, Scalar<D>{i}), best.box_edge);
  best.other_edge = hn::IfThenElse(less, hn::Set(d, Scalar<D>{j}), best.other_edge);
}

/// The two edges whose product the axis is.
template <class D, int axes>
struct Crossing {
  hn::Mask<D> is_box_edge[3], is_other_edge[axes];
  Vector<D> box_edge, other_edge;   ///< unit; zero, and any, where the axis is a face's
  hn::Vec<D> box_half, other_half;  ///< of their lengths
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

/// How a feature leans on a direction: -1 or 1 where it is one end, between where it is flat to within rounding.
template <class D>
HWY_INLINE hn::Vec<D> lean(D d, hn::Vec<D> component_of_normal, hn::Mask<D> sharp) {
  const auto one = hn::Set(d, Scalar<D>{1});
  const auto blunt = limited(d, component_of_normal * hn::Set(d, Scalar<D>{1e4}), one);
  return hn::IfThenElse(sharp, sign_of(d, component_of_normal), blunt);
}

/// The point of contact in the box's frame, given unit `normal` out of the box and `depth`.
///
/// `by_edge` lanes: two edges cross, and the point lies between their nearest points; `inverse_squared` is one over the
/// square of their product's length. Others: the part of each body that reaches farthest along the normal is a corner,
/// an edge or a face; a common point of the two, as seen along the normal, is found by projecting to and fro. Then the
/// point is moved along the normal to midway between the two surfaces.
template <class D, int axes>
HWY_INLINE Vector<D> contact_point(D d, const Vector<D>& box_half, const Zonotope<D, axes>& other,
                                   const Vector<D>& normal, hn::Vec<D> depth, hn::Mask<D> by_edge,
                                   const Crossing<D, axes>& crossing, hn::Vec<D> inverse_squared) {
  const auto one = hn::Set(d, Scalar<D>{1}), half = hn::Set(d, Scalar<D>(0.5));
  const auto& on = crossing.is_box_edge;
  const Vector<D> leans{hn::IfThenZeroElse(hn::And(by_edge, on[0]), lean(d, normal.x, by_edge)),
                        hn::IfThenZeroElse(hn::And(by_edge, on[1]), lean(d, normal.y, by_edge)),
                        hn::IfThenZeroElse(hn::And(by_edge, on[2]), lean(d, normal.z, by_edge))};
  const Vector<D> box_base{leans.x * box_half.x, leans.y * box_half.y, leans.z * box_half.z};
  const Vector<D> box_free{box_half.x * (one - hn::Abs(leans.x)), box_half.y * (one - hn::Abs(leans.y)),
                           box_half.z * (one - hn::Abs(leans.z))};

  Vector<D> other_base = other.centre;
  hn::Vec<D> other_free[axes];
  for (int k = 0; k < axes; ++k) {
    const auto leaning = hn::IfThenZeroElse(hn::And(by_edge, crossing.is_other_edge[k]),
                                            lean(d, dot(d, normal, other.axis[k]), by_edge));
    other_base = subtract(d, other_base, scale(d, other.axis[k], leaning * other.half[k]));
    other_free[k] = other.half[k] * (one - hn::Abs(leaning));
  }

  Vector<D> on_other = other_base, on_box = box_base;
  for (int round = 0; round < 3; ++round) {
    on_box = {box_base.x + limited(d, on_other.x - box_base.x, box_free.x),
              box_base.y + limited(d, on_other.y - box_base.y, box_free.y),
              box_base.z + limited(d, on_other.z - box_base.z, box_free.z)};
    if (round == 2) break;
    const Vector<D> from_base = subtract(d, on_box, other_base);
    on_other = other_base;
    for (int k = 0; k < axes; ++k) {
      on_other = add(d, on_other, scale(d, other.axis[k], limited(d, dot(d, other.axis[k], from_base), other_free[k])));
    }
  }

  // Crossing edges: where the two lines are nearest, held within the edges.
  const Vector<D> gap = subtract(d, other_base, box_base);
  const Vector<D> gap_by_edge = cross(d, gap, crossing.other_edge);
  auto s = limited(d, dot(d, gap_by_edge, crossing.product) * inverse_squared, crossing.box_half);
  const Vector<D> to_box = subtract(d, scale(d, crossing.box_edge, s), gap);
  const auto t = limited(d, dot(d, crossing.other_edge, to_box), crossing.other_half);
  const Vector<D> to_other = add(d, gap, scale(d, crossing.other_edge, t));
  s = limited(d, dot(d, crossing.box_edge, to_other), crossing.box_half);
  on_box = choose(d, by_edge, add(d, box_base, scale(d, crossing.box_edge, s)), on_box);
  on_other = choose(d, by_edge, add(d, other_base, scale(d, crossing.other_edge, t)), on_other);

  const Vector<D> middle = scale(d, add(d, on_box, on_other), half);
  const auto surface = hn::Abs(normal.x) * box_half.x + hn::Abs(normal.y) * box_half.y + hn::Abs(normal.z) * box_half.z;
  const auto shift = surface - depth * half - dot(d, normal, middle);
  return add(d, middle, scale(d, normal, shift));
}

}  // namespace ringfence::narrow_phase::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#endif
