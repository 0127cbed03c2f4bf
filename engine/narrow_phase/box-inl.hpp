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
  Vector<D> along;        ///< the product e_i x axis[j]
  hn::Vec<D> box_edge;    ///< i, as a number
  Vector<D> other_edge;   ///< axis[j]
  hn::Vec<D> other_half;  ///< half[j]
  hn::Mask<D> separated;  ///< some axis has no overlap
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

/// Takes e_i x other_edge for `best` where it overlaps less. `other_extent` is the second body's half extent along
/// the product, computed from the same components as the product itself, so that rounding scales with its length.
template <int i, class D>
HWY_INLINE void try_edge_axis(D d, const Vector<D>& box_half, const Vector<D>& centre, const Vector<D>& other_edge,
                              hn::Vec<D> other_half, hn::Vec<D> other_extent, EdgeAxis<D>& best) {
  constexpr int j = (i + 1) % 3, k = (i + 2) % 3;
  const auto a = component<j, D>(other_edge), b = component<k, D>(other_edge);
  const auto length_squared = a * a + b * b;
  const auto reach = component<j, D>(box_half) * hn::Abs(b) + component<k, D>(box_half) * hn::Abs(a) + other_extent;
  const auto apart = component<k, D>(centre) * a - component<j, D>(centre) * b;
  const auto overlap = reach - hn::Abs(apart);
  const auto valid = length_squared > least_edge_axis_squared(d);
  best.separated = hn::Or(best.separated, hn::And(valid, overlap < hn::Zero(d)));
  const auto overlap_squared = overlap * overlap;
  const auto less = hn::And(valid, overlap_squared * best.length_squared < best.overlap_squared * length_squared);
  best.overlap_squared = hn::IfThenElse(less, overlap_squared, best.overlap_squared);
  best.length_squared = hn::IfThenElse(less, length_squared, best.length_squared);
  const auto minus_b = hn::Neg(b), zero = hn::Zero(d);
  if constexpr (i == 0) best.along = choose(d, less, Vector<D>{zero, minus_b, a}, best.along);
  if constexpr (i == 1) best.along = choose(d, less, Vector<D>{a, zero, minus_b}, best.along);
  if constexpr (i == 2) best.along = choose(d, less, Vector<D>{minus_b, a, zero}, best.along);
  best.box_edge = hn::IfThenElse(less, hn::Set(d, Scalar<D>{i}), best.box_edge);
  best.other_edge = choose(d, less, other_edge, best.other_edge);
  best.other_half = hn::IfThenElse(less, other_half, best.other_half);
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
/// `by_edge` lanes: `edge` says which two edges cross; the point lies between their nearest points. Others: the part
/// of each body that reaches farthest along the normal is a corner, an edge or a face; a common point of the two, as
/// seen along the normal, is found by projecting to and fro. Then the point is moved along the normal to midway
/// between the two surfaces.
template <class D, int axes>
HWY_INLINE Vector<D> contact_point(D d, const Vector<D>& box_half, const Zonotope<D, axes>& other,
                                   const Vector<D>& normal, hn::Vec<D> depth, hn::Mask<D> by_edge,
                                   const EdgeAxis<D>& edge) {
  const auto zero = hn::Zero(d), one = hn::Set(d, Scalar<D>{1}), half = hn::Set(d, Scalar<D>(0.5));
  const hn::Vec<D> axis_number[3] = {zero, one, hn::Set(d, Scalar<D>{2})};

  const hn::Mask<D> is_x = hn::And(by_edge, edge.box_edge == axis_number[0]);
  const hn::Mask<D> is_y = hn::And(by_edge, edge.box_edge == axis_number[1]);
  const hn::Mask<D> is_z = hn::And(by_edge, edge.box_edge == axis_number[2]);
  const Vector<D> leans{hn::IfThenZeroElse(is_x, lean(d, normal.x, by_edge)),
                        hn::IfThenZeroElse(is_y, lean(d, normal.y, by_edge)),
                        hn::IfThenZeroElse(is_z, lean(d, normal.z, by_edge))};
  const Vector<D> box_base{leans.x * box_half.x, leans.y * box_half.y, leans.z * box_half.z};
  const Vector<D> box_free{box_half.x * (one - hn::Abs(leans.x)), box_half.y * (one - hn::Abs(leans.y)),
                           box_half.z * (one - hn::Abs(leans.z))};

  Vector<D> other_base = other.centre;
  hn::Vec<D> other_free[axes];
  for (int k = 0; k < axes; ++k) {
    const Vector<D>& axis = other.axis[k];
    const hn::Mask<D> is_edge = hn::And(
        by_edge,
        hn::And(axis.x == edge.other_edge.x, hn::And(axis.y == edge.other_edge.y, axis.z == edge.other_edge.z)));
    const auto leaning = hn::IfThenZeroElse(is_edge, lean(d, dot(d, normal, axis), by_edge));
    other_base = subtract(d, other_base, scale(d, axis, leaning * other.half[k]));
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
  const Vector<D> gap_by_edge = cross(d, gap, edge.other_edge);
  const Vector<D> box_edge{hn::IfThenElseZero(is_x, one), hn::IfThenElseZero(is_y, one), hn::IfThenElseZero(is_z, one)};
  const auto edge_half = dot(d, box_edge, box_half);
  auto s = dot(d, gap_by_edge, edge.along) / edge.length_squared;
  s = limited(d, s, edge_half);
  auto t = limited(d, dot(d, edge.other_edge, subtract(d, scale(d, box_edge, s), gap)), edge.other_half);
  s = limited(d, dot(d, box_edge, add(d, gap, scale(d, edge.other_edge, t))), edge_half);
  on_box = choose(d, by_edge, add(d, box_base, scale(d, box_edge, s)), on_box);
  on_other = choose(d, by_edge, add(d, other_base, scale(d, edge.other_edge, t)), on_other);

  const Vector<D> middle = scale(d, add(d, on_box, on_other), half);
  const auto surface = hn::Abs(normal.x) * box_half.x + hn::Abs(normal.y) * box_half.y + hn::Abs(normal.z) * box_half.z;
  const auto shift = surface - depth * half - dot(d, normal, middle);
  return add(d, middle, scale(d, normal, shift));
}

}  // namespace ringfence::narrow_phase::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#endif
