// Lower bounds of the overlap of a box and a hull along the normals of the hull's faces, for a block of pairs. Included
// once for each Highway target.

#if defined(RINGFENCE_NARROW_PHASE_BOX_HULL_BOUNDS_INL) == defined(HWY_TARGET_TOGGLE)
#ifdef RINGFENCE_NARROW_PHASE_BOX_HULL_BOUNDS_INL
#undef RINGFENCE_NARROW_PHASE_BOX_HULL_BOUNDS_INL
#else
#define RINGFENCE_NARROW_PHASE_BOX_HULL_BOUNDS_INL
#endif

#include <algorithm>
#include <bit>
#include <cstddef>
#include <cstdint>

#include "narrow_phase/hull/box_hull_pairs-inl.hpp"
#include "narrow_phase/hull/fixed_point-inl.hpp"

HWY_BEFORE_NAMESPACE();
namespace ringfence::narrow_phase::HWY_NAMESPACE {

/// Selects faces and edges of hulls by bounds in fixed point. What is selected in addition to what is needed overlaps
/// more than the best direction, so the result of the test does not depend on the bounds.
///
/// Each normal n of a face has a *deepest corner* of the box, on the side opposite to the signs of n. Its depth below
/// the face is the overlap along n: Σ h_k·|n_k| + the depth of the centre, h being the half extents. The depth of its
/// *neighbour* along axis k, the corner on the other side of this axis, is less by 2·h_k·|n_k|. These four numbers of a
/// face decide which edges can have a lesser overlap: see RelevantEdge.
///
/// The unit of a pair is a 32,000th of a radius: at least the greatest depth of the box's centre below a face and three
/// times the greatest half extent. Overlaps beyond 16 bits are saturated, which keeps them lower bounds.
///
/// Errors in units: of a product h_k·n_k less than 2.7 (its factors 0.9 and 0.3, three products of 16 bits 1.5); of an
/// overlap less than 12.7 (three of them, and the depth of the centre 4.7: its position 0.9, the normal 0.9, three
/// products 1.5, the distance of the plane 0.5, its conversion 0.9). Where a product is that small, its sign may be
/// wrong.
class BoxHullBounds : private FixedPoint {
 public:
  explicit BoxHullBounds(const BoxHullPairs& pairs) : pairs_(pairs) {}

  /// Bounds the overlap along the normals of all faces of the hulls of undecided pairs.
  void bound_faces() {
    // Decided pairs have lanes too: their hulls have any size.
    for (std::size_t i = 0; i < block_pairs; i += BoxHullPairs::lanes) hn::Store(hn::Set(d, 1e18f), d, extent_ + i);
    for (std::size_t u = 0; u < pairs_.undecided.count; ++u) {
      const std::size_t i = pairs_.undecided.pair[u];
      extent_[i] = pairs_.hull[i]->extent();
      numbers_.reserve(i, *pairs_.hull[i]);
    }
    for (std::size_t i = 0; i < pairs_.count; i += BoxHullPairs::lanes) place(i);
    for (std::size_t u = 0; u < pairs_.undecided.count; ++u) bound_faces_of(pairs_.undecided.pair[u]);
  }

  /// Calls `first(face)` for the first face whose bound is the least within the errors, and `other(face)` for all
  /// others: there is seldom one.
  template <class First, class Other>
  HWY_INLINE void for_each_least(std::size_t i, const First& first, const Other& other) {
    const int least = least_.get(i);
    bool found = false;
    for_each_within(i, static_cast<std::int16_t>(std::min<int>(least + window, greatest)),
                    [&](std::uint64_t bits, std::size_t f) HWY_ATTR {
                      if (!found && bits != 0) {
                        first(f + static_cast<std::size_t>(std::countr_zero(bits)));
                        bits &= bits - 1;
                        found = true;
                      }
                      for_each_bit(bits, f, other);
                    });
  }

  /// For pairs from i on and the normal of a face in the axes of the box: whether a product h_k·n_k may have the wrong
  /// sign. One bit for each pair.
  HWY_INLINE std::uint32_t uncertain_signs(std::size_t i, const Vector<D>& normal) const {
    const V least = hn::Min(hn::Min(hn::Abs(normal.x) * pairs_.half(0, i), hn::Abs(normal.y) * pairs_.half(1, i)),
                            hn::Abs(normal.z) * pairs_.half(2, i));
    return bits_of(d, hn::Lt(least * hn::Load(d, units_ + i), hn::Set(d, 3.0f)));
  }
  /// Gives the products of a face the signs of its normal.
  void correct_signs(std::size_t i, std::size_t face, Vec3f normal) {
    std::int16_t* const number = numbers_.at(i, face);
    const float n[3] = {normal.x, normal.y, normal.z};
    for (std::size_t k = 0; k < 3; ++k) {
      std::int16_t& along = number[(product + k) * stride];
      along = n[k] < 0 ? std::min<std::int16_t>(along, -1) : std::max<std::int16_t>(along, 0);
    }
  }

  /// Makes the best overlap the limit for mark_faces().
  void limit_edges() {
    for (std::size_t i = 0; i < pairs_.count; i += BoxHullPairs::lanes) store_limit(i);
  }
  /// Writes a byte for each face of one hull. Bit k is set if coordinate k of its normal is negative, bit 3 + k if the
  /// neighbour of its deepest corner along axis k is too deep; k counts from the last axis. Writes up to the end of the
  /// last vector.
  HWY_INLINE void mark_faces(std::size_t i, std::uint8_t* out) {
    const std::size_t faces = pairs_.hull[i]->face_count();
    const F limit = hn::Set(fixed, limit_[i]);
    const hn::Rebind<std::uint8_t, Fixed> bytes;
    const auto marks = [&](std::size_t f) HWY_ATTR { return hn::DemoteTo(bytes, marks_of(numbers_.at(i, f), limit)); };
#if HWY_TARGET == HWY_SCALAR
    for (std::size_t f = 0; f < faces; ++f) hn::StoreU(marks(f), bytes, out + f);
#else
    // Two vectors at a time, because the load of a whole table waits for narrower stores.
    const hn::Twice<decltype(bytes)> both;
    for (std::size_t f = 0; f < faces; f += 2 * FixedPoint::lanes) {
      const auto low = marks(f);
      const auto high = f + FixedPoint::lanes < faces ? marks(f + FixedPoint::lanes) : low;
      hn::StoreU(hn::Combine(both, high, low), both, out + f);
    }
#endif
  }

 private:
  static constexpr float units_in_radius = 32000;
  /// How much greater than the least a bound is if the face cannot have the least overlap, and if its overlap is so
  /// great that the signs of two products may be wrong: twice the error of an overlap, and four times that of a
  /// product.
  static constexpr int window = 37;
  /// How much deeper than the best overlap a neighbour's depth must be: the error of an overlap and of two products,
  /// and four times that of a product for wrong signs on the two other axes, rounded up.
  static constexpr float depth_error = 32;
  /// The numbers of a face: h_k·n_k of three axes, and the bound of the overlap.
  enum : std::size_t { product, bound = 3 };

  /// Chooses the units, and converts what bound_faces_of() reads.
  void place(std::size_t i) {
    const Rotation<D> r = pairs_.placed.rotation_lanes(d, i);
    const V extent = hn::Load(d, extent_ + i);
    const Vector<D> half = pairs_.half_lanes(i), from = negate(d, pairs_.hull_centres(i));
    const V longest = hn::Max(hn::Max(half.x, half.y), half.z);
    const V radius = hn::Max(extent + hn::Sqrt(dot(d, from, from)), hn::Set(d, 3.0f) * longest);
    const V units = hn::Set(d, units_in_radius) / radius;
    hn::Store(units, d, units_ + i);
    store(extent * units, fixed_extent_ + i);
    const Vector<D> in_hull = scale(d, unrotate(d, r, from), units);
    store(in_hull.x, centre_[0] + i);
    store(in_hull.y, centre_[1] + i);
    store(in_hull.z, centre_[2] + i);
    const V length[3] = {half.x * units, half.y * units, half.z * units};
    for (std::size_t k = 0; k < 3; ++k) {
      for (std::size_t j = 0; j < 3; ++j) store(r.m[k][j] * length[k], rows_[k][j] + i);
    }
  }

  HWY_INLINE void bound_faces_of(std::size_t i) {
    const auto spread = [&](const std::int16_t(&column)[block_pairs]) HWY_ATTR { return hn::Set(fixed, column[i]); };
    const auto row = [&](const std::int16_t(&columns)[3][block_pairs]) HWY_ATTR {
      return Row{spread(columns[0]), spread(columns[1]), spread(columns[2])};
    };
    const Row box[3] = {row(rows_[0]), row(rows_[1]), row(rows_[2])}, centre = row(centre_);
    const F extent = spread(fixed_extent_);
    F least = hn::Set(fixed, greatest);
    numbers_.for_each_vector(
        *pairs_.hull[i], i, [&](const std::int16_t* planes, std::int16_t* out, std::size_t) HWY_ATTR {
          const Row normal{hn::Load(fixed, planes), hn::Load(fixed, planes + stride),
                           hn::Load(fixed, planes + 2 * stride)};
          F overlap = hn::SaturatedSub(hn::MulFixedPoint15(hn::Load(fixed, planes + 3 * stride), extent),
                                       along(normal, centre));
          for (std::size_t k = 0; k < 3; ++k) {
            const F component = along(normal, box[k]);
            hn::Store(component, fixed, out + (product + k) * stride);
            overlap = hn::SaturatedAdd(overlap, hn::Abs(component));
          }
          hn::Store(overlap, fixed, out + bound * stride);
          least = hn::Min(least, overlap);
        });
    least_.put(i, least);
  }

  /// A vector of fixed-point vectors, or the same in all lanes.
  struct Row {
    F x, y, z;
  };
  static HWY_INLINE F along(const Row& p, const Row& q) {
    return hn::Add(hn::Add(hn::MulFixedPoint15(p.x, q.x), hn::MulFixedPoint15(p.y, q.y)),
                   hn::MulFixedPoint15(p.z, q.z));
  }

  /// Calls `visit(bits, f)` with one bit for each of the 64 faces from f on: whether its bound is at most `limit`.
  template <class Visit>
  HWY_INLINE void for_each_within(std::size_t i, std::int16_t limit, const Visit& visit) {
    const geometry::Hull& hull = *pairs_.hull[i];
    const F most = hn::Set(fixed, limit);
    std::uint64_t word = 0;
    numbers_.for_each_vector(hull, i, [&](const std::int16_t*, const std::int16_t* numbers, std::size_t f) HWY_ATTR {
      const auto above = hn::Gt(hn::Load(fixed, numbers + bound * stride), most);
      word |= std::uint64_t{~bits_of(fixed, above) & first_bits(FixedPoint::lanes) & real_faces(hull, f)} << f % 64;
      if ((f + FixedPoint::lanes) % 64 == 0 || f + FixedPoint::lanes >= hull.face_count()) {
        visit(word, f / 64 * 64);
        word = 0;
      }
    });
  }
  template <class Visit>
  static HWY_INLINE void for_each_bit(std::uint64_t bits, std::size_t first, const Visit& visit) {
    for (; HWY_UNLIKELY(bits != 0); bits &= bits - 1) visit(first + static_cast<std::size_t>(std::countr_zero(bits)));
  }

  /// For limit_edges(): the best overlap, more by what rounding could make of it and by the errors of bounds.
  HWY_INLINE void store_limit(std::size_t i) {
    const V most = hn::Load(d, pairs_.best + i) + hn::Set(d, Rounding<float>::overlap) * hn::Load(d, pairs_.size + i);
    store(hn::Min(most * hn::Load(d, units_ + i) + hn::Set(d, depth_error), hn::Set(d, float{greatest})), limit_ + i);
  }

  /// The bits of a vector of faces.
  static HWY_INLINE F marks_of(const std::int16_t* numbers, F limit) {
    const F beyond = hn::ShiftRight<1>(hn::SaturatedSub(hn::Load(fixed, numbers + bound * stride), limit));
    F marks = hn::Zero(fixed);
    for (std::size_t k = 0; k < 3; ++k) {
      marks = push_sign(marks, hn::Sub(hn::Abs(hn::Load(fixed, numbers + (product + k) * stride)), beyond));
    }
    for (std::size_t k = 0; k < 3; ++k) marks = push_sign(marks, hn::Load(fixed, numbers + (product + k) * stride));
    return marks;
  }
  /// Twice `bits`, and one more where a number is negative.
  static HWY_INLINE F push_sign(F bits, F number) {
#if HWY_TARGET == HWY_AVX3_DL
    return F{_mm512_shldi_epi16(bits.raw, number.raw, 1)};
#else
    const hn::RebindToUnsigned<Fixed> sign;
    return hn::Add(hn::Add(bits, bits), hn::BitCast(fixed, hn::ShiftRight<15>(hn::BitCast(sign, number))));
#endif
  }

  const BoxHullPairs& pairs_;
  FixedColumns<4> numbers_;
  LeastFixed least_;
  alignas(64) float extent_[block_pairs];  // of the hulls
  alignas(64) float units_[block_pairs];   // units in a metre
  alignas(64) std::int16_t fixed_extent_[block_pairs];
  alignas(64) std::int16_t centre_[3][block_pairs];   // of the box, from the hull's centroid in the hull's axes
  alignas(64) std::int16_t rows_[3][3][block_pairs];  // the axes of the box in the hull's axes times the half extents
  alignas(64) std::int16_t limit_[block_pairs];
};

}  // namespace ringfence::narrow_phase::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#endif
