#pragma once

#include <algorithm>

#include "geometry/vector.hpp"
#include "narrow_phase/query/shape_hit.hpp"

namespace ringfence::narrow_phase {

/// A ray on the axes of a shape. Places on it are given in metres from its foot, the point that is nearest to the
/// shape's origin, so that they are precise for rays that start far away.
struct LocalRay {
  Vec3d origin;       ///< where the ray starts
  Vec3d direction;    ///< unit
  Vec3d foot;         ///< the point of the line nearest to the shape's origin
  double begin = 0;   ///< place of `origin`
  double end = 0;     ///< place where the ray ends
  double length = 0;  ///< of the ray
  double slack = 0;   ///< metres: rounding; a hit this far before the begin or behind the end counts

  LocalRay() noexcept = default;  ///< all zero
  /// `size`: radius of a ball around the shape's origin that contains the shape. Precondition: the length is not 0.
  LocalRay(const Ray& ray, const Vec3d& position, const geometry::RotationD& rotation, double size) noexcept
      : origin(geometry::rotate_inverse(rotation, ray.start - position)),
        direction(geometry::rotate_inverse(rotation, ray.direction)),
        begin(dot(origin, direction)),
        length(ray.length) {
    foot = origin - direction * begin;
    end = begin + ray.length;
    slack = 0x1p-46 * (size + ringfence::length(origin));
  }

  /// Whether the line misses the ball around the shape's origin, but for rounding. `size` as above.
  bool misses_ball(double size) const noexcept { return dot(foot, foot) > size * size * (1 + 0x1p-20) + slack * slack; }
  Vec3d at(double place) const noexcept { return foot + direction * place; }
  /// A place that no hit with at most this fraction exceeds.
  double place_of(double fraction) const noexcept { return begin + fraction * length * (1 + 0x1p-40) + slack; }
  double fraction_of(double place) const noexcept { return std::clamp((place - begin) / length, 0.0, 1.0); }
  /// Whether a place is before the end.
  bool reaches(double place) const noexcept { return place <= end + slack; }
};

/// A place on a LocalRay where it enters a shape, and the unit normal there, on the shape's axes.
struct LocalHit {
  double place = 0;
  Vec3d normal;
};

}  // namespace ringfence::narrow_phase
