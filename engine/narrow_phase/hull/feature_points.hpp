#pragma once

#include <cstddef>
#include <span>

#include "ringfence/pose.hpp"

namespace ringfence::narrow_phase {

inline constexpr std::size_t max_feature_points = 256;

/// The points of a polytope that are farthest along a direction: a corner, the ends of an edge, the corners of a face,
/// in any order. Memory that is not initialised: it is as large as the largest face there can be.
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

/// Where two parallel features meet: seen along the unit vector `normal`, a point of the hull of `first` and of that of
/// `second`, in the middle of what they share; its height along `normal` is of no meaning.
///
/// At most max_feature_points each. Where they share nothing but by rounding, the middle of the nearest two points. In
/// double, no allocation.
Vec3d common_point(std::span<const Vec3d> first, std::span<const Vec3d> second, Vec3d normal) noexcept;

}  // namespace ringfence::narrow_phase
