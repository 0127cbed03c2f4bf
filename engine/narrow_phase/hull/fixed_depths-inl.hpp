// Depths of points below the faces of hulls in fixed point, for a block of pairs. Included once for each Highway
// target.

#if defined(RINGFENCE_NARROW_PHASE_FIXED_DEPTHS_INL) == defined(HWY_TARGET_TOGGLE)
#ifdef RINGFENCE_NARROW_PHASE_FIXED_DEPTHS_INL
#undef RINGFENCE_NARROW_PHASE_FIXED_DEPTHS_INL
#else
#define RINGFENCE_NARROW_PHASE_FIXED_DEPTHS_INL
#endif

#include <cstddef>
#include <cstdint>

#include "narrow_phase/hull/fixed_point-inl.hpp"

HWY_BEFORE_NAMESPACE();
namespace ringfence::narrow_phase::HWY_NAMESPACE {

/// How deep up to three points lie below each face of one hull of each pair, in numbers of 16 bits, for bounds. Use:
/// set_units() and set_point() for all pairs, reserve() once for each, then for_each_vector() any number of times.
///
/// The unit of a pair is a 16,000th of a radius: that of a ball around the centroid of the hull that contains the hull
/// and the points. So a depth is between -1 and 2 radii. One radius is subtracted, and one more can be added, so that
/// what is computed fits into 16 bits.
///
/// Error of a depth in units, less than 5: the points 0.9, the normals 0.6, three products 1.5, the distance of the
/// plane 0.5, its conversion 1. What is decided by depths must stay right if they are off by `error`.
class FixedDepths : public FixedPoint {
 public:
  static constexpr std::size_t points = 3;
  static constexpr float units_in_radius = 16000;
  /// In units; one more than the error of a depth, for the rounding of what it is compared with.
  static constexpr float error = 6;

  /// Sets the units in a metre of the pairs from `i` on, one per lane. `extent` is that of the hulls.
  HWY_INLINE void set_units(std::size_t i, V units, V extent) {
    hn::Store(units, d, units_ + i);
    store(extent * units, extent_ + i);
  }
  HWY_INLINE V units(std::size_t i) const { return hn::Load(d, units_ + i); }

  /// Sets a point of the pairs from `i` on, relative to the centroids of the hulls.
  HWY_INLINE void set_point(std::size_t i, std::size_t which, const Vector<D>& p) {
    const V scale = units(i);
    store(p.x * scale, point_[which][0] + i);
    store(p.y * scale, point_[which][1] + i);
    store(p.z * scale, point_[which][2] + i);
  }

  /// Writes what depths are compared with, of any size.
  static HWY_INLINE void store_limit(V depths, std::int16_t* to) {
    store(hn::Min(depths, hn::Set(d, 3 * units_in_radius)) - hn::Set(d, units_in_radius), to);
  }

  /// Reserves memory for the depths of one pair.
  HWY_INLINE void reserve(std::size_t i, const geometry::Hull& hull) { depths_.reserve(i, hull); }

  /// A point of one pair in all lanes.
  struct Spread {
    F x, y, z;
  };
  HWY_INLINE Spread point(std::size_t which, std::size_t i) const {
    return {hn::Set(fixed, point_[which][0][i]), hn::Set(fixed, point_[which][1][i]),
            hn::Set(fixed, point_[which][2][i])};
  }
  HWY_INLINE F extent(std::size_t i) const { return hn::Set(fixed, extent_[i]); }

  /// A vector of faces of one pair.
  class Faces {
   public:
    HWY_INLINE Faces(const std::int16_t* planes, std::int16_t* depths) : planes_(planes), depths_(depths) {}

    /// The distance of the planes from the centroid, less one radius.
    HWY_INLINE F distance(F extent) const {
      return hn::Sub(hn::MulFixedPoint15(hn::Load(fixed, planes_ + 3 * stride), extent),
                     hn::Set(fixed, static_cast<std::int16_t>(units_in_radius)));
    }
    /// Computes and stores the depths of a point.
    HWY_INLINE F compute(std::size_t which, F plane_distance, const Spread& p) const {
      const F x = hn::MulFixedPoint15(hn::Load(fixed, planes_), p.x),
              y = hn::MulFixedPoint15(hn::Load(fixed, planes_ + stride), p.y),
              z = hn::MulFixedPoint15(hn::Load(fixed, planes_ + 2 * stride), p.z);
      const F depth = hn::Sub(hn::Sub(plane_distance, x), hn::Add(y, z));
      hn::Store(depth, fixed, depths_ + which * stride);
      return depth;
    }
    HWY_INLINE F depth(std::size_t which) const { return hn::Load(fixed, depths_ + which * stride); }

   private:
    const std::int16_t* planes_;
    std::int16_t* depths_;
  };

  /// Calls `visit(faces, f)` for each vector of faces of one pair: those from f on.
  template <class Visit>
  HWY_INLINE void for_each_vector(const geometry::Hull& hull, std::size_t i, const Visit& visit) {
    depths_.for_each_vector(hull, i, [&](const std::int16_t* planes, std::int16_t* depths, std::size_t f) HWY_ATTR {
      visit(Faces(planes, depths), f);
    });
  }

 private:
  FixedColumns<points> depths_;
  alignas(64) float units_[block_pairs];
  alignas(64) std::int16_t extent_[block_pairs];
  alignas(64) std::int16_t point_[points][3][block_pairs];
};

}  // namespace ringfence::narrow_phase::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#endif
