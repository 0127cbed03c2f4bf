#pragma once

#include <cstdint>
#include <type_traits>

#include "ringfence/pose.hpp"

namespace ringfence::geometry {

/// An axis-aligned box in 32-bit fixed point relative to the world's bounds. Comparison is exact: one SIMD compare for
/// each axis.
///
/// Closed: two bounds that share a face, an edge or a corner touch. Coordinates saturate at 0 and 2^32 - 1. Results
/// stay correct there, but all saturated bounds touch each other, so FixedSpace can have steps outside the world's
/// bounds too.
struct Bounds {
  std::uint32_t lower[3];
  std::uint32_t upper[3];
  constexpr bool operator==(const Bounds&) const noexcept = default;
};
static_assert(sizeof(Bounds) == 24 && std::is_trivially_copyable_v<Bounds>);

/// Whether two bounds overlap or touch.
constexpr bool touch(const Bounds& p, const Bounds& q) noexcept {
  return p.lower[0] <= q.upper[0] && q.lower[0] <= p.upper[0] && p.lower[1] <= q.upper[1] && q.lower[1] <= p.upper[1] &&
         p.lower[2] <= q.upper[2] && q.lower[2] <= p.upper[2];
}

/// Whether a point, computed by FixedSpace::point, lies in the bounds or on their surface.
constexpr bool contains(const Bounds& bounds, const std::uint32_t point[3]) noexcept {
  return bounds.lower[0] <= point[0] && point[0] <= bounds.upper[0] && bounds.lower[1] <= point[1] &&
         point[1] <= bounds.upper[1] && bounds.lower[2] <= point[2] && point[2] <= bounds.upper[2];
}

/// Whether `inner` lies within `outer`. Six subtractions and no branch.
constexpr bool contains(const Bounds& outer, const Bounds& inner) noexcept {
  std::uint64_t below = 0;  // the top bit is set if any difference is negative
  for (int axis = 0; axis < 3; ++axis) {
    below |= std::uint64_t{inner.lower[axis]} - outer.lower[axis];
    below |= std::uint64_t{outer.upper[axis]} - inner.upper[axis];
  }
  return below >> 63 == 0;
}

/// The result of FixedSpace::point in the layout of the kernels: one coordinate for each axis; the fourth is 0.
struct FixedPoint {
  alignas(16) std::uint32_t at[4];
};

/// Two objects whose bounds overlap or touch. The function that returns pairs states which object is `a`.
struct CandidatePair {
  std::uint32_t a;  ///< index in the caller's table of objects
  std::uint32_t b;
  constexpr bool operator==(const CandidatePair&) const noexcept = default;
};
static_assert(sizeof(CandidatePair) == 8);

/// Steps of FixedSpace, clamped to its bounds and rounded down.
inline std::uint32_t rounded_down(double step) noexcept {
  constexpr double max_step = 4294967295.0;
  const double positive = step > 0.0 ? step : 0.0;
  // The conversion truncates, which rounds down because the value is not negative. std::floor would be a library call
  // on processors without SSE4.1.
  return static_cast<std::uint32_t>(static_cast<std::int64_t>(positive < max_step ? positive : max_step));
}

/// What FixedSpace does with coordinates outside its bounds.
enum class Outside : std::uint8_t {
  saturates,   ///< they lie on the faces of the bounds
  has_octaves  ///< steps that grow with the distance cover 2^64 times the side in each direction
};

/// Converts metres to the fixed point of Bounds.
///
/// Each axis of the world's bounds is divided into 2^32 steps (2.3 mm in a world 10^7 m wide). Rounds outwards, so
/// boxes that touch have bounds that touch. Monotone and a pure function: every node on every machine computes the same
/// bits. Immutable while it is in use.
///
/// With Outside::has_octaves, 1/128 of the steps lies below the bounds and as many above them. The first 2^19 of these
/// cover a length of one side, the next 2^19 two more sides, and so on, each octave twice the length of the one before.
/// So a step is at most 2^-18 of the distance from the bounds plus one side, wherever other objects are.
class FixedSpace {
 public:
  /// `min` and `max` are the world's bounds in metres. A side shorter than 1 m is extended upwards to 1 m. Throws
  /// ringfence::Error if a side is not finite or `min` > `max`.
  FixedSpace(Vec3d min, Vec3d max, Outside outside = Outside::saturates);

  /// The bounds of a box given in metres. Precondition: min <= max on each axis, no NaN.
  Bounds bounds(Vec3d min, Vec3d max) const noexcept;

  /// The fixed-point coordinates of a position, rounded down, because cells are half-open. Precondition: no NaN.
  void point(Vec3d position, std::uint32_t out[3]) const noexcept {
    out[0] = rounded_down(rows_.step_at(position.x, 0));
    out[1] = rounded_down(rows_.step_at(position.y, 1));
    out[2] = rounded_down(rows_.step_at(position.z, 2));
  }

  Vec3d min() const noexcept { return min_; }
  Vec3d max() const noexcept { return max_; }
  /// Steps for each metre within the bounds, by axis.
  Vec3d scale() const noexcept { return {rows_.scale[0], rows_.scale[1], rows_.scale[2]}; }

  /// Converts metres to steps, in the layout of the kernels: one coordinate for each axis; the fourth is 0, and within
  /// the range of `first` and `last`.
  struct Rows {
    alignas(32) double min[4];  ///< metres, of step 0 if there were no octaves
    double scale[4];
    double first[4], last[4];  ///< the steps within the bounds, both included; infinite with Outside::saturates

    /// The step of a coordinate, neither rounded nor clamped.
    double step_at(double place, int axis) const noexcept {
      const double step = (place - min[axis]) * scale[axis];
      return ((step < first[axis]) | (step > last[axis])) ? outer_step(step) : step;
    }
    /// The step of an octave, whole, from one below first[0] or above last[0] that has the size of a step within.
    double outer_step(double step) const noexcept;
  };
  const Rows& rows() const noexcept { return rows_; }

 private:
  Rows rows_;
  Vec3d min_, max_;
};

}  // namespace ringfence::geometry
