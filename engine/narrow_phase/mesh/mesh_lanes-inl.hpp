// Boxes and triangles of a mesh in lanes, and the bounds by which they are excluded. Included once for each Highway
// target.

#if defined(RINGFENCE_NARROW_PHASE_MESH_LANES_INL) == defined(HWY_TARGET_TOGGLE)
#ifdef RINGFENCE_NARROW_PHASE_MESH_LANES_INL
#undef RINGFENCE_NARROW_PHASE_MESH_LANES_INL
#else
#define RINGFENCE_NARROW_PHASE_MESH_LANES_INL
#endif

#include <cmath>
#include <cstddef>
#include <cstdint>

#include "narrow_phase/simd/lanes-inl.hpp"

HWY_BEFORE_NAMESPACE();
namespace ringfence::narrow_phase::HWY_NAMESPACE {

/// Number of boxes or triangles that are tested together, for every vector width.
inline constexpr std::size_t group_size = 16;
/// The error of a bound in float, as part of the two sizes: more than twenty rounding errors.
inline constexpr double bound_margin = 2e-6;

using FloatLanes = hn::CappedTag<float, group_size>;

/// Loads columns of four floats side by side, from `lane` on as many as a vector holds; `block(i)` points to the i-th
/// column.
template <class D, class Block>
HWY_INLINE hn::Vec<D> load_blocks(D d, std::size_t lane, const Block& block) {
#if HWY_TARGET == HWY_SCALAR
  return hn::Load(d, block(lane / 4) + lane % 4);
#else
  const std::size_t i = lane / 4;
  const hn::CappedTag<float, 4> quarter;
  if constexpr (hn::MaxLanes(D()) == 16) {
    const hn::CappedTag<float, 8> half;
    return hn::Combine(d, hn::Combine(half, hn::Load(quarter, block(i + 3)), hn::Load(quarter, block(i + 2))),
                       hn::Combine(half, hn::Load(quarter, block(i + 1)), hn::Load(quarter, block(i))));
  } else if constexpr (hn::MaxLanes(D()) == 8) {
    return hn::Combine(d, hn::Load(quarter, block(i + 1)), hn::Load(quarter, block(i)));
  } else {
    static_assert(hn::MaxLanes(D()) == 4);
    return hn::Load(d, block(i));
  }
#endif
}

template <class D>
HWY_INLINE std::uint32_t bits_of_mask(D d, hn::Mask<D> mask) {
  std::uint8_t bytes[8] = {};
  hn::StoreMaskBits(d, mask, bytes);
  return bytes[0] | static_cast<std::uint32_t>(bytes[1]) << 8;
}

template <class D>
HWY_INLINE hn::Vec<D> at(D d, double value) {
  return hn::Set(d, static_cast<float>(value));
}

/// Whether `overlap` divided by the square root of `squared` is at least `least`, without computing the root: compares
/// squares that keep their sign.
template <class D>
HWY_INLINE hn::Mask<D> reaches(D d, hn::Vec<D> overlap, hn::Vec<D> squared, float least) {
  return overlap * hn::Abs(overlap) >= hn::Set(d, least * std::abs(least)) * squared;
}

/// The four boxes of each of up to four nodes, in lanes.
template <class D>
struct BoxLanes {
  Vector<D> centre, half;
};

/// Triangles in lanes.
template <class D>
struct TriangleLanes {
  Vector<D> corner[3];
  Vector<D> normal;
};

/// The lanes of a group that remain, and their bounds.
struct BoundedLanes {
  alignas(64) float bound[group_size];
  std::uint32_t bits = 0;

  template <class D>
  HWY_INLINE void put(D d, std::size_t lane, hn::Vec<D> bounds, float floor) {
    hn::Store(bounds, d, bound + lane);
    bits |= bits_of_mask(d, bounds >= hn::Set(d, floor)) << lane;
  }
  /// Removes the lane with the largest bound, the first of equal ones, and returns it. Precondition: one remains.
  HWY_INLINE std::uint32_t take_largest() {
    auto best = static_cast<std::uint32_t>(__builtin_ctz(bits));
    for (std::uint32_t rest = bits & (bits - 1); rest != 0; rest &= rest - 1) {
      const auto lane = static_cast<std::uint32_t>(__builtin_ctz(rest));
      best = bound[lane] > bound[best] ? lane : best;
    }
    bits &= ~(1u << best);
    return best;
  }
};

template <class D>
HWY_INLINE Vector<D> spread_out(D d, Vec3d p) {
  return {at(d, p.x), at(d, p.y), at(d, p.z)};
}

constexpr int next_of(int i) { return i == 2 ? 0 : i + 1; }

/// Minimum and maximum of the three corners along an axis.
template <class D>
struct Span {
  hn::Vec<D> low, high;

  static HWY_INLINE Span of(hn::Vec<D> p, hn::Vec<D> q, hn::Vec<D> r) {
    return {hn::Min(p, hn::Min(q, r)), hn::Max(p, hn::Max(q, r))};
  }
  static HWY_INLINE Span of(hn::Vec<D> p, hn::Vec<D> q) { return {hn::Min(p, q), hn::Max(p, q)}; }
  /// The overlap with the interval [-half, half], for a translation in either direction.
  HWY_INLINE hn::Vec<D> overlap(hn::Vec<D> half) const { return half - hn::Max(low, hn::Neg(high)); }
};

/// Squares of lengths below this are not divided by.
inline constexpr float least_squared = 1e-30f;

/// A direction along which two shapes are far apart: from a point of one to a point of the other, the nearest of
/// several such pairs. It need not be the best one, because the overlap along any direction is a bound of the depth.
template <class D>
class NearDirection {
 public:
  explicit NearDirection(D d) : squared_(hn::Set(d, 1e30f)), direction_{hn::Zero(d), hn::Zero(d), hn::Zero(d)} {}

  HWY_INLINE void take(D d, const Vector<D>& from_one_to_other) {
    const auto squared = dot(d, from_one_to_other, from_one_to_other);
    direction_ = choose(d, squared < squared_, from_one_to_other, direction_);
    squared_ = hn::Min(squared, squared_);
  }
  const Vector<D>& get() const { return direction_; }
  /// The smaller of `bound` and the overlap along the direction, which is given times the length of the direction.
  HWY_INLINE hn::Vec<D> bound(D d, hn::Vec<D> bound, hn::Vec<D> overlap) const {
    const auto known = squared_ > hn::Set(d, least_squared);
    return hn::IfThenElse(known, hn::Min(bound, overlap / hn::Sqrt(squared_)), bound);
  }

 private:
  hn::Vec<D> squared_;
  Vector<D> direction_;
};

/// Where on an edge the point is whose distance from its start, times the length of the edge, is `product`; clamped to
/// the edge: from 0 to 1.
template <class D>
HWY_INLINE hn::Vec<D> part_of_edge(D d, hn::Vec<D> product, hn::Vec<D> squared_length) {
  const auto part = product / hn::Max(squared_length, hn::Set(d, least_squared));
  return hn::Min(hn::Max(part, hn::Zero(d)), hn::Set(d, 1.0f));
}

/// The sum of absolute products: how far a box of that half size reaches along an axis, times the length of the axis.
template <class D>
HWY_INLINE hn::Vec<D> reach_along(D d, const Vector<D>& axis, const Vector<D>& half) {
  return dot(d, Vector<D>{hn::Abs(axis.x), hn::Abs(axis.y), hn::Abs(axis.z)}, half);
}

}  // namespace ringfence::narrow_phase::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#endif
