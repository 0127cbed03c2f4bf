// Gathers candidate pairs into lanes, for the closed-form kernels. Included once for each Highway target.
//
// Bodies and shapes are rows in memory. Rows are joined to vectors in registers, one row in each 128-bit block, and
// four such vectors become four vectors of lanes by a transposition within the blocks. Nothing goes through memory,
// where a wide load would wait for the narrow stores before it.

#if defined(RINGFENCE_NARROW_PHASE_PAIR_LANES_INL) == defined(HWY_TARGET_TOGGLE)
#ifdef RINGFENCE_NARROW_PHASE_PAIR_LANES_INL
#undef RINGFENCE_NARROW_PHASE_PAIR_LANES_INL
#else
#define RINGFENCE_NARROW_PHASE_PAIR_LANES_INL
#endif

#include <cstddef>
#include <cstdint>

#include "geometry/rows-inl.hpp"
#include "narrow_phase/kernel.hpp"
#include "narrow_phase/simd/lanes-inl.hpp"

HWY_BEFORE_NAMESPACE();
namespace ringfence::narrow_phase::HWY_NAMESPACE {

/// The input of a kernel in lanes. Only the fields that the kinds need are filled: a sphere has no orientation.
template <class D>
struct Lanes {
  Vector<D> offset;  ///< from the first body's position to the second's, metres
  Quaternion<D> first_orientation, second_orientation;
  Vector<D> first_size, second_size;  ///< as in ShapeRow::size
};

HWY_INLINE std::uint32_t first_of(const KernelPair& pair) { return pair.first; }
HWY_INLINE std::uint32_t second_of(const KernelPair& pair) { return pair.second; }
HWY_INLINE std::uint32_t first_of(const geometry::CandidatePair& pair) { return pair.a; }
HWY_INLINE std::uint32_t second_of(const geometry::CandidatePair& pair) { return pair.b; }

/// The pairs of consecutive lanes lie one after the other.
template <class Pair>
struct AdjacentPairs {
  const Pair* first;

  HWY_INLINE const Pair& operator()(std::size_t lane) const { return first[lane]; }
};

#if HWY_TARGET == HWY_SCALAR

/// Gathers as many pairs as `d` has lanes, one: `pair_of(lane)` is the pair of a lane.
template <class K, class D, class PairOf>
HWY_INLINE Lanes<D> gather(D d, const KernelInput& input, const PairOf& pair_of) {
  const Body &p = input.bodies[first_of(pair_of(0))], &q = input.bodies[second_of(pair_of(0))];
  const float *p_size = input.shapes.row(p.shape).size, *q_size = input.shapes.row(q.shape).size;
  const Quat &p_turn = p.pose.orientation, &q_turn = q.pose.orientation;
  const auto lane = [d](auto value) { return hn::Set(d, static_cast<float>(value)); };
  return {{lane(q.pose.position.x - p.pose.position.x), lane(q.pose.position.y - p.pose.position.y),
           lane(q.pose.position.z - p.pose.position.z)},
          {lane(p_turn.x), lane(p_turn.y), lane(p_turn.z), lane(p_turn.w)},
          {lane(q_turn.x), lane(q_turn.y), lane(q_turn.z), lane(q_turn.w)},
          {lane(p_size[0]), lane(p_size[1]), lane(p_size[2])},
          {lane(q_size[0]), lane(q_size[1]), lane(q_size[2])}};
}

#else

using geometry::HWY_NAMESPACE::join_rows;
using geometry::HWY_NAMESPACE::transpose;

/// second - first in the first three floats, computed in double, then rounded. The fourth is zero.
template <class D>
HWY_INLINE hn::Vec<D> offset_row(D d, const Body& first, const Body& second) {
  const double *from = &first.pose.position.x, *to = &second.pose.position.x;
#if HWY_MAX_BYTES >= 32
  // Reads eight bytes past z, which are still inside the body. They are masked before the conversion, which could be
  // slow for arbitrary bits.
  const hn::FixedTag<double, 4> position;
  return hn::DemoteTo(d,
                      hn::IfThenElseZero(hn::FirstN(position, 3), hn::LoadU(position, to) - hn::LoadU(position, from)));
#else
  const hn::FixedTag<double, 2> xy;
  const hn::FixedTag<double, 1> z;
  const hn::FixedTag<float, 2> half;
  return hn::Combine(
      d,
      hn::ZeroExtendVector(half, hn::DemoteTo(hn::FixedTag<float, 1>(), hn::LoadU(z, to + 2) - hn::LoadU(z, from + 2))),
      hn::DemoteTo(half, hn::LoadU(xy, to) - hn::LoadU(xy, from)));
#endif
}

/// The same for the lanes `lane`, `lane` + 4, ..., one in each 128-bit block.
template <class D, class First, class Second>
HWY_INLINE hn::Vec<D> join_offsets(D d, const First& first, const Second& second, std::size_t lane) {
  if constexpr (hn::MaxLanes(D()) == 4) {
    return offset_row(d, first(lane), second(lane));
  } else {
    const hn::Half<D> half;
    return hn::Combine(d, join_offsets(half, first, second, lane + hn::MaxLanes(half)),
                       join_offsets(half, first, second, lane));
  }
}

/// The rows of a vector of pairs: element r has the rows of the lanes r, r + 4, ..., one in each 128-bit block.
template <class K, class D>
struct JoinedRows {
  hn::Vec<D> offset[4], first_orientation[4], second_orientation[4], first_size[4], second_size[4];

  /// Everything of four lanes at a time, so that their addresses are used up before the next are computed.
  template <class PairOf>
  HWY_INLINE void join(D d, const KernelInput& input, const PairOf& pair_of, std::size_t r) {
    const Body* const bodies = input.bodies.data();
    const geometry::ShapeRow* const rows = input.shapes.rows();
    const auto first = [&](std::size_t lane) -> const Body& { return bodies[first_of(pair_of(lane))]; };
    const auto second = [&](std::size_t lane) -> const Body& { return bodies[second_of(pair_of(lane))]; };
    offset[r] = join_offsets(d, first, second, r);
    if constexpr (K::first != ShapeKind::sphere) {
      first_orientation[r] = join_rows(
          d, [&](std::size_t lane) { return &first(lane).pose.orientation.x; }, r);
    }
    if constexpr (K::second != ShapeKind::sphere) {
      second_orientation[r] = join_rows(
          d, [&](std::size_t lane) { return &second(lane).pose.orientation.x; }, r);
    }
    first_size[r] = join_rows(
        d, [&](std::size_t lane) { return size_row<K::first>(rows[first(lane).shape], r); }, r);
    second_size[r] = join_rows(
        d, [&](std::size_t lane) { return size_row<K::second>(rows[second(lane).shape], r); }, r);
  }

 private:
  /// Where row r of a shape's size begins. That of a sphere begins so that float r is the bounding radius, which is the
  /// radius.
  template <ShapeKind kind>
  static HWY_INLINE const float* size_row(const geometry::ShapeRow& shape, std::size_t r) {
    static_assert(offsetof(geometry::ShapeRow, bounding_radius) == 3 * sizeof(float));
    if constexpr (kind == ShapeKind::sphere) return shape.size + (3 - r);
    return shape.size;
  }
};

template <class D>
HWY_INLINE Vector<D> vector_of(D d, const hn::Vec<D>* rows) {
  hn::Vec<D> v[4];
  transpose(d, rows[0], rows[1], rows[2], rows[3], v);
  return {v[0], v[1], v[2]};
}

template <class D>
HWY_INLINE Quaternion<D> quaternion_of(D d, const hn::Vec<D>* rows) {
  hn::Vec<D> v[4];
  transpose(d, rows[0], rows[1], rows[2], rows[3], v);
  return {v[0], v[1], v[2], v[3]};
}

/// The sizes of shapes of a kind. Those of spheres, which have only one number, need no transposition: it is taken from
/// the diagonal of the rows.
template <ShapeKind kind, class D>
HWY_INLINE Vector<D> size_of(D d, const hn::Vec<D>* rows) {
  if constexpr (kind == ShapeKind::sphere) {
    const hn::Repartition<std::uint64_t, D> wide;
    const auto lower = hn::BitCast(wide, hn::OddEven(rows[1], rows[0]));
    const auto upper = hn::BitCast(wide, hn::OddEven(rows[3], rows[2]));
    return {hn::BitCast(d, hn::OddEven(upper, lower)), hn::Zero(d), hn::Zero(d)};
  } else {
    return vector_of(d, rows);
  }
}

/// Gathers as many pairs as `d` has lanes: `pair_of(lane)` is the pair of a lane.
template <class K, class D, class PairOf>
HWY_INLINE Lanes<D> gather(D d, const KernelInput& input, const PairOf& pair_of) {
  JoinedRows<K, D> rows;
  rows.join(d, input, pair_of, 0);
  rows.join(d, input, pair_of, 1);
  rows.join(d, input, pair_of, 2);
  rows.join(d, input, pair_of, 3);
  Lanes<D> out;
  out.offset = vector_of(d, rows.offset);
  if constexpr (K::first != ShapeKind::sphere) out.first_orientation = quaternion_of(d, rows.first_orientation);
  if constexpr (K::second != ShapeKind::sphere) out.second_orientation = quaternion_of(d, rows.second_orientation);
  out.first_size = size_of<K::first>(d, rows.first_size);
  out.second_size = size_of<K::second>(d, rows.second_size);
  return out;
}

#endif

}  // namespace ringfence::narrow_phase::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#endif
