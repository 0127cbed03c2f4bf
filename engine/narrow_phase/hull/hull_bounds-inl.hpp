// Lower bounds of the overlap of two hulls along the normals of their faces, for a block of pairs. Included once for
// each Highway target.

#if defined(RINGFENCE_NARROW_PHASE_HULL_BOUNDS_INL) == defined(HWY_TARGET_TOGGLE)
#ifdef RINGFENCE_NARROW_PHASE_HULL_BOUNDS_INL
#undef RINGFENCE_NARROW_PHASE_HULL_BOUNDS_INL
#else
#define RINGFENCE_NARROW_PHASE_HULL_BOUNDS_INL
#endif

#include <algorithm>
#include <bit>
#include <cstddef>
#include <cstdint>

#include "narrow_phase/hull/fixed_depths-inl.hpp"
#include "narrow_phase/hull/hull_edges-inl.hpp"
#include "narrow_phase/hull/hull_pairs-inl.hpp"

HWY_BEFORE_NAMESPACE();
namespace ringfence::narrow_phase::HWY_NAMESPACE {

#if HWY_TARGET != HWY_SCALAR

/// Selects faces and edges by lower bounds of the overlap, in fixed point. The bounds are those of PolytopePair: by the
/// ball inside the other hull and by two of its vertices. All that PolytopePair selects with bounds in float is
/// selected. What is selected in addition overlaps more than the best direction, so the result of the test is the same.
///
/// Both hulls of a pair have the same unit of length.
class HullBounds {
 public:
  explicit HullBounds(const HullPairs& pairs) : pairs_(pairs) {}

  /// Bounds the overlap along all faces by the ball and the first vertex.
  void bound_faces() {
    set_zero(extent_);
    set_zero(inner_radius_);
    for (std::size_t u = 0; u < pairs_.undecided.count; ++u) reserve(pairs_.undecided.pair[u]);
    for (std::size_t i = 0; i < pairs_.count; i += lanes) place_first_points(i);
    for (std::size_t u = 0; u < pairs_.undecided.count; ++u) {
      for (std::size_t side = 0; side < 2; ++side) bound_faces_of(side, pairs_.undecided.pair[u]);
    }
  }

  /// The face of one hull with the least bound, computed in float; the first if there are several.
  HWY_INLINE std::size_t least_face(std::size_t side, std::size_t i) {
    const geometry::Hull& own = hull(side, i);
    const F ball = hn::Set(fixed, ball_[side][i]),
            limit = hn::SaturatedAdd(hn::Set(fixed, least_[side].get(i)), hn::Set(fixed, window_[i]));
    std::size_t face = 0, found = 0;
    depths_[side].for_each_vector(own, i, [&](const Faces& faces, std::size_t f) HWY_ATTR {
      const F bound = hn::Max(hn::Add(faces.depth(of_ball), ball), faces.depth(of_first));
      const std::uint32_t bits = bits_of(fixed, hn::Lt(bound, limit)) & FixedPoint::real_faces(own, f);
      found += static_cast<std::size_t>(std::popcount(bits));
      face = bits != 0 ? f + static_cast<std::size_t>(std::countr_zero(bits)) : face;
    });
    return HWY_LIKELY(found == 1) ? face : least_face_in_float(side, i);
  }

  /// Adds the second vertices to the bounds. The best overlap so far is the limit for list_faces().
  void add_second_points() {
    for (std::size_t i = 0; i < pairs_.count; i += lanes) place_second_points(i);
  }

  /// Appends the faces of one hull, except `evaluated`, whose bound is less than the limit: the pair in the upper 16
  /// bits, the face in the lower 16. Returns the new count. May write four entries more.
  HWY_INLINE std::size_t list_faces(std::size_t side, std::size_t i, std::size_t evaluated, std::uint32_t* items,
                                    std::size_t count) {
    const geometry::Hull& own = hull(side, i);
    FixedDepths& depths = depths_[side];
    const FixedDepths::Spread second = depths.point(of_second, i);
    const F ball = hn::Set(fixed, ball_[side][i]), limit = hn::Set(fixed, limit_[i]), extent = depths.extent(i);
    std::uint64_t word = 0;
    depths.for_each_vector(own, i, [&](const Faces& faces, std::size_t f) HWY_ATTR {
      const F bound = hn::Max(faces.compute(of_second, faces.distance(extent), second),
                              hn::Max(hn::Add(faces.depth(of_ball), ball), faces.depth(of_first)));
      word |= std::uint64_t{bits_of(fixed, hn::Lt(bound, limit)) & FixedPoint::real_faces(own, f)} << f % 64;
      if ((f + FixedDepths::lanes) % 64 == 0 || f + FixedDepths::lanes >= own.face_count()) {
        word &= ~(std::uint64_t{evaluated / 64 == f / 64} << evaluated % 64);
        count = append_few_bits(word, i << 16 | f / 64 * 64, items, count);
        word = 0;
      }
    });
    return count;
  }

  /// Makes the best overlap of all faces the limit for mark_faces().
  void limit_edges() {
    for (std::size_t i = 0; i < pairs_.count; i += lanes) {
      const V best = most(i), units = depths_[0].units(i);
      const V error = hn::Set(d, FixedDepths::error - 1);  // because depths must be greater than the limit
      FixedDepths::store_limit(best * units + error, edges_by_point_ + i);
      for (std::size_t side = 0; side < 2; ++side) {
        const V beyond_ball = hn::Max(best - hn::Load(d, inner_radius_[side] + i), hn::Zero(d));
        FixedDepths::store_limit(beyond_ball * units + error, edges_by_ball_[side] + i);
      }
    }
  }

  /// Writes a byte for each face of one hull, with one bit for the ball of the other and one for each of its points:
  /// set if it is too deep below the face. Writes up to the end of the last group of faces.
  HWY_INLINE void mark_faces(std::size_t side, std::size_t i, std::uint8_t* out) {
    const F by_ball = hn::Set(fixed, edges_by_ball_[side][i]), by_point = hn::Set(fixed, edges_by_point_[i]);
    const auto bit = [&](F depth, F limit, std::int16_t value)
                         HWY_ATTR { return hn::IfThenElseZero(hn::Gt(depth, limit), hn::Set(fixed, value)); };
    const hn::Rebind<std::uint8_t, FixedDepths::Fixed> bytes;
    depths_[side].for_each_vector(hull(side, i), i, [&](const Faces& faces, std::size_t f) HWY_ATTR {
      const F bits = hn::Or(hn::Or(bit(faces.depth(of_ball), by_ball, 1), bit(faces.depth(of_first), by_point, 2)),
                            bit(faces.depth(of_second), by_point, 4));
      hn::StoreU(hn::DemoteTo(bytes, bits), bytes, out + f);
    });
  }

 private:
  using D = HullPairs::D;
  using V = HullPairs::V;
  using F = FixedDepths::F;
  using Faces = FixedDepths::Faces;
  static constexpr D d{};
  static constexpr std::size_t lanes = HullPairs::lanes;
  static constexpr FixedDepths::Fixed fixed{};
  /// The points whose depths are computed.
  enum : std::size_t { of_ball, of_first, of_second };

  HWY_INLINE const geometry::Hull& hull(std::size_t side, std::size_t i) const { return *pairs_.hull[side][i]; }
  /// The best overlap so far, more by what rounding could make of it.
  HWY_INLINE V most(std::size_t i) const {
    return hn::Load(d, pairs_.best + i) + hn::Set(d, Rounding<float>::overlap) * hn::Load(d, pairs_.size + i);
  }
  HWY_INLINE void reserve(std::size_t i) {
    for (std::size_t side = 0; side < 2; ++side) {
      extent_[side][i] = hull(side, i).extent();
      inner_radius_[side][i] = hull(1 - side, i).inner_radius();
      depths_[side].reserve(i, hull(side, i));
    }
  }

  /// A point of the other hull relative to the centroid of one hull, in the axes of that hull.
  HWY_INLINE Vector<D> from_centroid(std::size_t side, std::size_t i, const float (&point)[3][block_pairs]) const {
    return subtract(d, load(d, point, i), pairs_.centroids(side, i));
  }

  void place_first_points(std::size_t i) {
    Vector<D> first[2];
    V squared = hn::LoadU(d, pairs_.placed.axis_squared() + i), radius = hn::Zero(d);
    for (std::size_t side = 0; side < 2; ++side) {
      first[side] = from_centroid(side, i, pairs_.point[0][side]);
      squared = hn::Max(squared, dot(d, first[side], first[side]));
      radius = hn::Max(radius, hn::Load(d, extent_[side] + i));
    }
    radius = hn::Max(radius, hn::Sqrt(squared) * hn::Set(d, 1 + 1e-5f));
    const V units = hn::Set(d, FixedDepths::units_in_radius) / radius;
    hn::Store(radius * radius, d, squared_radius_ + i);
    for (std::size_t side = 0; side < 2; ++side) {
      FixedDepths& depths = depths_[side];
      depths.set_units(i, units, hn::Load(d, extent_[side] + i));
      depths.set_point(i, of_ball, from_centroid(side, i, pairs_.ball[side]));
      depths.set_point(i, of_first, first[side]);
      FixedDepths::store(hn::Load(d, inner_radius_[side] + i) * units, ball_[side] + i);
    }
    // The errors of two bounds and of two bounds in float, rounded up.
    const V in_float = hn::Set(d, 2 * Rounding<float>::overlap) * hn::Load(d, pairs_.size + i) * units;
    FixedDepths::store(
        hn::Min(in_float, hn::Set(d, FixedDepths::units_in_radius)) + hn::Set(d, 2 * FixedDepths::error + 2),
        window_ + i);
  }

  void place_second_points(std::size_t i) {
    const V squared_radius = hn::Load(d, squared_radius_ + i);
    FixedDepths::store_limit(most(i) * depths_[0].units(i) + hn::Set(d, FixedDepths::error), limit_ + i);
    for (std::size_t side = 0; side < 2; ++side) {
      // A vertex outside of the radius cannot be represented: the first one takes its place.
      const Vector<D> first = from_centroid(side, i, pairs_.point[0][side]),
                      second = from_centroid(side, i, pairs_.point[1][side]);
      const auto inside = hn::Le(dot(d, second, second), squared_radius);
      depths_[side].set_point(i, of_second, choose(d, inside, second, first));
    }
  }

  HWY_INLINE void bound_faces_of(std::size_t side, std::size_t i) {
    FixedDepths& depths = depths_[side];
    const FixedDepths::Spread centre = depths.point(of_ball, i), first = depths.point(of_first, i);
    const F ball = hn::Set(fixed, ball_[side][i]), extent = depths.extent(i);
    F least = hn::Set(fixed, FixedPoint::greatest);
    depths.for_each_vector(hull(side, i), i, [&](const Faces& faces, std::size_t) HWY_ATTR {
      const F distance = faces.distance(extent);
      const F by_ball = hn::Add(faces.compute(of_ball, distance, centre), ball);
      least = hn::Min(least, hn::Max(by_ball, faces.compute(of_first, distance, first)));
    });
    least_[side].put(i, least);
  }

  /// For hulls with several faces whose bounds are equal within the error.
  HWY_NOINLINE std::size_t least_face_in_float(std::size_t side, std::size_t i) const {
    const geometry::Hull& own = hull(side, i);
    const auto centre = spread_out(d, at(pairs_.ball[side], i)), first = spread_out(d, at(pairs_.point[0][side], i));
    const V radius = hn::Set(d, hull(1 - side, i).inner_radius());
    const auto bound = [&](std::size_t f) HWY_ATTR {
      const auto normal = read(d, own.normal_x() + f, own.normal_y() + f, own.normal_z() + f);
      const V height = hn::Load(d, own.offset() + f);
      return hn::Max((height - dot_of(d, normal, centre)) + radius, height - dot_of(d, normal, first));
    };
    Least<float> least(bound(0));
    for (std::size_t f = lanes; f < own.face_count(); f += lanes) least.add(bound(f), f);
    return least.index();
  }

  const HullPairs& pairs_;
  FixedDepths depths_[2];
  alignas(64) float extent_[2][block_pairs];        // of the hull of each side
  alignas(64) float inner_radius_[2][block_pairs];  // of the other hull
  alignas(64) float squared_radius_[block_pairs];   // of the ball that holds the hulls and the points
  alignas(64) std::int16_t ball_[2][block_pairs];   // the same in units
  LeastFixed least_[2];
  alignas(64) std::int16_t window_[block_pairs];  // what bounds must differ by for one to be less in float
  alignas(64) std::int16_t limit_[block_pairs];
  alignas(64) std::int16_t edges_by_point_[block_pairs], edges_by_ball_[2][block_pairs];
};

#endif

}  // namespace ringfence::narrow_phase::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#endif
