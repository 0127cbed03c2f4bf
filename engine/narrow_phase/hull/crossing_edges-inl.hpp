// The points where two edges cross, one pair of edges per lane. Included once for each Highway target.

#if defined(RINGFENCE_NARROW_PHASE_CROSSING_EDGES_INL) == defined(HWY_TARGET_TOGGLE)
#ifdef RINGFENCE_NARROW_PHASE_CROSSING_EDGES_INL
#undef RINGFENCE_NARROW_PHASE_CROSSING_EDGES_INL
#else
#define RINGFENCE_NARROW_PHASE_CROSSING_EDGES_INL
#endif

#include <cstddef>
#include <cstdint>

#include "narrow_phase/hull/polytope_lanes-inl.hpp"
#include "narrow_phase/simd/pair_block-inl.hpp"

HWY_BEFORE_NAMESPACE();
namespace ringfence::narrow_phase::HWY_NAMESPACE {

/// Collects up to `most` pairs of edges, and computes the common point of each pair in double: the same operations as
/// common_point() for two segments, at the given height along the normal.
template <std::size_t most>
class CrossingEdges {
 public:
  using D = Columns16<float>;

  /// Adds the lanes of `mask`: lane k is the pair of bodies `i` + k. `first` and `last` are the ends of either edge.
  HWY_INLINE void add(D d, hn::Mask<D> mask, std::size_t i, const Vector<D>& normal, hn::Vec<D> height,
                      const Vector<D>& first_of_a, const Vector<D>& last_of_a, const Vector<D>& first_of_b,
                      const Vector<D>& last_of_b) {
    const hn::Vec<D> all[columns] = {normal.x,    normal.y,    normal.z,    first_of_a.x, first_of_a.y, first_of_a.z,
                                     last_of_a.x, last_of_a.y, last_of_a.z, first_of_b.x, first_of_b.y, first_of_b.z,
                                     last_of_b.x, last_of_b.y, last_of_b.z, height};
    const hn::RebindToUnsigned<D> ids;
    const auto lanes = lanes_of(d, mask);
    hn::StoreU(hn::Add(lanes, hn::Set(ids, static_cast<std::uint32_t>(i))), ids, pair + count);
    const auto order = hn::IndicesFromVec(d, lanes);
    for (std::size_t c = 0; c < columns; ++c) hn::StoreU(hn::TableLookupLanes(all[c], order), d, column_[c] + count);
    count += hn::CountTrue(d, mask);
  }

  void compute() {
    for (std::size_t k = 0; k < count; k += hn::Lanes(Wide())) compute_common(k);
    const D d;
    for (std::size_t k = 0; k < count; k += hn::Lanes(d)) {
      const auto real = hn::FirstN(d, count - k);
      const auto part = [&](const float* c) HWY_ATTR { return hn::IfThenElseZero(real, hn::LoadU(d, c + k)); };
      const auto column = [&](const Column* c) HWY_ATTR { return Vector<D>{part(c[0]), part(c[1]), part(c[2])}; };
      const Vector<D> normal = column(column_ + normal_column), common = column(point_);
      const auto rise = part(column_[height_column]) - dot(d, normal, common);
      const Vector<D> point = ringfence::narrow_phase::HWY_NAMESPACE::add(d, common, scale(d, normal, rise));
      hn::StoreU(point.x, d, point_[0] + k);
      hn::StoreU(point.y, d, point_[1] + k);
      hn::StoreU(point.z, d, point_[2] + k);
    }
  }

  /// Whether the edges of the k-th pair are not too nearly parallel for compute().
  bool found(std::size_t k) const { return (found_ >> k & 1) != 0; }
  Vec3f at(std::size_t k) const { return {point_[0][k], point_[1][k], point_[2][k]}; }

  std::size_t count = 0;
  std::uint32_t pair[most + geometry::hull_lanes];  ///< the bodies of each

 private:
  using Wide = Columns16<double>;
  using Column = float[most + geometry::hull_lanes];
  /// The first columns of what is collected.
  enum : std::size_t {
    normal_column = 0,
    first_a_column = 3,
    last_a_column = 6,
    first_b_column = 9,
    last_b_column = 12,
    height_column = 15,
    columns
  };

  /// Entries past the last are zero, since leftovers on the stack could be slow to compute with.
  static HWY_INLINE Vector<Wide> load(Wide wide, hn::Mask<Wide> real, const Column* column, std::size_t k) {
    const hn::Rebind<float, Wide> narrow;
    const auto part = [&](const float* c)
                          HWY_ATTR { return hn::IfThenElseZero(real, hn::PromoteTo(wide, hn::LoadU(narrow, c + k))); };
    return {part(column[0]), part(column[1]), part(column[2])};
  }
  static HWY_INLINE hn::Vec<Wide> clamped(Wide wide, hn::Vec<Wide> part) {
    const auto zero = hn::Zero(wide), one = hn::Set(wide, 1.0);
    return hn::IfThenElse(hn::Lt(part, zero), zero, hn::IfThenElse(hn::Lt(one, part), one, part));
  }
  static HWY_INLINE Vector<Wide> along(Wide wide, const Vector<Wide>& from, const Vector<Wide>& edge,
                                       hn::Vec<Wide> part) {
    return ringfence::narrow_phase::HWY_NAMESPACE::add(wide, from, scale(wide, edge, part));
  }
  /// The point of an edge that is nearest to a point, both projected along the normal.
  static HWY_INLINE Vector<Wide> nearest(Wide wide, const Vector<Wide>& normal, const Vector<Wide>& from,
                                         const Vector<Wide>& edge, const Vector<Wide>& to) {
    const Vector<Wide> gap = subtract(wide, to, from);
    const Vector<Wide> level = subtract(wide, edge, scale(wide, normal, dot(wide, normal, edge)));
    return along(wide, from, edge, clamped(wide, dot(wide, gap, level) / dot(wide, level, level)));
  }

  HWY_INLINE void compute_common(std::size_t k) {
    const Wide wide;
    const auto real = hn::FirstN(wide, count - k);
    const Vector<Wide> normal = load(wide, real, column_ + normal_column, k);
    const Vector<Wide> p = load(wide, real, column_ + first_a_column, k),
                       q = load(wide, real, column_ + first_b_column, k);
    const Vector<Wide> p_edge = subtract(wide, load(wide, real, column_ + last_a_column, k), p);
    const Vector<Wide> q_edge = subtract(wide, load(wide, real, column_ + last_b_column, k), q);
    const auto sine = dot(wide, normal, cross(wide, p_edge, q_edge));
    const auto least = hn::Set(wide, 1e-12) * dot(wide, p_edge, p_edge) * dot(wide, q_edge, q_edge);
    found_ |= bits_of(wide, hn::Gt(sine * sine, least)) << k;
    const auto part = dot(wide, normal, cross(wide, subtract(wide, q, p), q_edge)) / sine;
    // Clamped to both edges: where only their ends are close, the lines may cross far away.
    const Vector<Wide> near = nearest(wide, normal, q, q_edge, along(wide, p, p_edge, clamped(wide, part)));
    const Vector<Wide> other = nearest(wide, normal, p, p_edge, near);
    const auto half = hn::Set(wide, 0.5);
    const hn::Rebind<float, Wide> narrow;
    hn::StoreU(hn::DemoteTo(narrow, (other.x + near.x) * half), narrow, point_[0] + k);
    hn::StoreU(hn::DemoteTo(narrow, (other.y + near.y) * half), narrow, point_[1] + k);
    hn::StoreU(hn::DemoteTo(narrow, (other.z + near.z) * half), narrow, point_[2] + k);
  }

  alignas(64) Column column_[columns];
  alignas(64) Column point_[3];
  std::uint32_t found_ = 0;
};

}  // namespace ringfence::narrow_phase::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#endif
