#pragma once

#include <array>
#include <cstddef>

#include "ringfence/pose.hpp"

namespace ringfence::narrow_phase {

/// The way downhill for the support height of a convex body over the directions about one: the last few support points
/// that were met, each a plane below which that height is nowhere.
///
/// Height is convex over the plane of directions n + x u + y v, so where it has a crease (a flat side, an edge) steps
/// to either side get stuck, and planes do not: two of them meet in the crease, three in its lowest point. Method:
/// cutting planes (Kelley 1960) within bounds. Threads: belongs to its owner. Allocates nothing.
class CuttingPlanes {
 public:
  /// One more support point; the oldest gives way.
  void add(const Vec3d& support);
  /// The direction n + x u + y v, |x| and |y| at most `most`, in which the highest of the points is lowest; n itself
  /// without points. n, u and v are orthonormal.
  Vec3d lowest(const Vec3d& n, const Vec3d& u, const Vec3d& v, double most) const;

 private:
  static constexpr std::size_t kept = 8;
  std::array<Vec3d, kept> points_{};
  std::size_t added_ = 0;
};

}  // namespace ringfence::narrow_phase
