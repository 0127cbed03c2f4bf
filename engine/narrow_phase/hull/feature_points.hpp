#pragma once

#include <cstddef>
#include <span>

#include "ringfence/pose.hpp"

namespace ringfence::narrow_phase {

inline constexpr std::size_t max_feature_points = 256;

/// The points of a polytope that are farthest along a direction: a corner, the ends of an edge, or the corners of a
/// face, in any order. The array is not initialised, because it is as large as the largest possible face.
class FeaturePoints {
 public:
  FeaturePoints() noexcept {}
  void add(Vec3d p) noexcept { points_[count_++].p = p; }
  std::span<const Vec3d> get() const noexcept { return {&points_[0].p, count_}; }

 private:
  union Slot {
    Slot() noexcept {}
    Vec3d p;
  };
  static_assert(sizeof(Slot) == sizeof(Vec3d));
  Slot points_[max_feature_points];
  std::size_t count_ = 0;
};

/// A common point of two parallel features. In the projection along the unit vector `normal` it lies in the convex hull
/// of `first` and in that of `second`, in the middle of their intersection. Its height along `normal` is arbitrary.
///
/// At most max_feature_points each. If the features intersect only because of rounding, or not at all, the result is
/// the middle of the two nearest points. Computes in double. No allocation.
Vec3d common_point(std::span<const Vec3d> first, std::span<const Vec3d> second, Vec3d normal) noexcept;

/// The distance of a point from the convex hull of a feature, both projected along the unit vector `normal`; 0 inside.
double distance_from_feature(std::span<const Vec3d> feature, Vec3d point, Vec3d normal) noexcept;

}  // namespace ringfence::narrow_phase
