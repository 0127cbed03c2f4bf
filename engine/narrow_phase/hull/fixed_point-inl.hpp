// Numbers of 16 bits for the faces of hulls, for a block of pairs: what bounds are computed with. A vector holds twice
// as many of them as floats, and those of a block stay in the first-level cache between the steps of a test. Included
// once for each Highway target.

#if defined(RINGFENCE_NARROW_PHASE_FIXED_POINT_INL) == defined(HWY_TARGET_TOGGLE)
#ifdef RINGFENCE_NARROW_PHASE_FIXED_POINT_INL
#undef RINGFENCE_NARROW_PHASE_FIXED_POINT_INL
#else
#define RINGFENCE_NARROW_PHASE_FIXED_POINT_INL
#endif

#include <algorithm>
#include <cstddef>
#include <cstdint>

#include "narrow_phase/hull/hull_block-inl.hpp"

HWY_BEFORE_NAMESPACE();
namespace ringfence::narrow_phase::HWY_NAMESPACE {

/// Lengths in numbers of 16 bits. Each pair has its own unit, a small part of its size.
struct FixedPoint {
  using D = Columns16<float>;
  using V = hn::Vec<D>;
  using Fixed = hn::CappedTag<std::int16_t, geometry::fixed_point_lanes>;
  using F = hn::Vec<Fixed>;
  static constexpr D d{};
  static constexpr Fixed fixed{};
  static constexpr std::size_t lanes = hn::MaxLanes(Fixed());
  static constexpr std::size_t stride = geometry::fixed_point_lanes;  ///< faces whose numbers lie one after the other
  static constexpr std::int16_t greatest = 32767;

  /// Writes lengths in units, each less than 2^22: rounded to the nearest, saturated to 16 bits.
  static HWY_INLINE void store(V lengths, std::int16_t* to) {
    const hn::Rebind<std::int16_t, D> narrow;
    const hn::RebindToSigned<D> ints;
    // Neighbouring floats of this size differ by 1, so the sum is rounded to a whole number, which is in its lowest
    // bits.
    const V big = hn::Set(d, 12582912.0f);
    const auto whole = hn::Sub(hn::BitCast(ints, lengths + big), hn::BitCast(ints, big));
    hn::StoreU(hn::DemoteTo(narrow, whole), narrow, to);
  }

  /// One bit for each face of a vector that starts at face `f`: set unless it is padding.
  static HWY_INLINE std::uint32_t real_faces(const geometry::Hull& hull, std::size_t f) {
    return first_bits(hull.face_count() - f);
  }
};

/// Some numbers for each face of one hull of each pair: the numbers of `stride` faces lie one after the other, in
/// `columns` columns, as the planes of the hull do.
template <std::size_t columns>
class FixedColumns {
 public:
  /// Reserves memory for one pair.
  HWY_INLINE void reserve(std::size_t i, const geometry::Hull& hull) {
    begin_[i] = used_;
    used_ += columns * geometry::padded_fixed_point(hull.face_count());
  }

  /// Calls `visit(planes, numbers, f)` for each vector of faces of one pair, those from f on: pointers to the first
  /// columns of their planes and of their numbers.
  template <class Visit>
  HWY_INLINE void for_each_vector(const geometry::Hull& hull, std::size_t i, const Visit& visit) {
    const std::int16_t* planes = hull.fixed_point_planes();
    std::int16_t* numbers = numbers_ + begin_[i];
    for (std::size_t f = 0; f < hull.face_count(); f += stride, planes += 4 * stride, numbers += columns * stride) {
      const std::size_t end = lanes < stride ? std::min(stride, hull.face_count() - f) : stride;
      for (std::size_t k = 0; k < end; k += lanes) visit(planes + k, numbers + k, f + k);
    }
  }

  /// The first column of the numbers of the faces from f on.
  HWY_INLINE std::int16_t* at(std::size_t i, std::size_t f) {
    return numbers_ + begin_[i] + f / stride * (columns * stride) + f % stride;
  }

 private:
  static constexpr std::size_t lanes = FixedPoint::lanes, stride = FixedPoint::stride;
  std::size_t used_ = 0;
  std::size_t begin_[block_pairs];
  alignas(64) std::int16_t numbers_[block_pairs * columns * max_faces];
};

/// The least number of each pair. Stored as several lanes, so that no step waits for the chain of shuffles.
class LeastFixed {
 public:
  HWY_INLINE void put(std::size_t i, FixedPoint::F v) { put_lanes(FixedPoint::fixed, v, least_[i]); }
  HWY_INLINE std::int16_t get(std::size_t i) const {
    const hn::CappedTag<std::int16_t, kept> few;
    return hn::GetLane(hn::MinOfLanes(few, hn::Load(few, least_[i])));
  }

 private:
  static constexpr std::size_t kept = 8;

  template <class E>
  static HWY_INLINE void put_lanes(E e, hn::Vec<E> v, std::int16_t* to) {
#if HWY_TARGET != HWY_SCALAR
    if constexpr (hn::MaxLanes(E()) > kept) {
      const hn::Half<E> half;
      return put_lanes(half, hn::Min(hn::LowerHalf(half, v), hn::UpperHalf(half, v)), to);
    }
#endif
    hn::StoreU(v, e, to);
  }

  alignas(64) std::int16_t least_[block_pairs][kept];
};

}  // namespace ringfence::narrow_phase::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#endif
