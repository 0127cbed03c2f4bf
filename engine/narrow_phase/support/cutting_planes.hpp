#pragma once

#include <array>
#include <cstddef>

#include "ringfence/pose.hpp"

namespace ringfence::narrow_phase {

/// Finds a direction in which the support height of a convex body is lower, near a given direction, from its last few
/// support points. Each support point gives a plane that is a lower bound of the height.
///
/// The height is convex over the directions n + x u + y v. Where it has a crease (because of a flat face or an edge),
/// steps to either side make no progress, but the bounds do: two of them intersect in the crease, three in its lowest
/// point. Method: cutting planes (Kelley 1960) within bounds. Threads: one at a time. Allocates nothing.
class CuttingPlanes {
 public:
  /// Adds a support point; replaces the oldest one.
  void add(const Vec3d& support);
  /// The direction n + x u + y v with |x| and |y| at most `most` in which the maximum of the points' heights is lowest;
  /// n itself if there are no points. n, u and v are orthonormal.
  Vec3d lowest(const Vec3d& n, const Vec3d& u, const Vec3d& v, double most) const;

 private:
  static constexpr std::size_t kept = 8;
  std::array<Vec3d, kept> points_{};
  std::size_t added_ = 0;
};

}  // namespace ringfence::narrow_phase
