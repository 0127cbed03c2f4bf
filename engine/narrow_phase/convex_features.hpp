#pragma once

#include <span>

#include "ringfence/pose.hpp"

namespace ringfence::narrow_phase {

/// Where two parallel features meet: seen along the unit vector `normal`, a point of the hull of `first` and of that of
/// `second`, in the middle of what they share; its height along `normal` is of no meaning.
///
/// The features are the points of a polytope that are farthest along a direction: a corner, the ends of an edge, the
/// corners of a face, in any order, at most max_feature_points each. Where they share nothing but by rounding, the
/// middle of the nearest two points. In double, no allocation.
Vec3d meeting_point(std::span<const Vec3d> first, std::span<const Vec3d> second, Vec3d normal) noexcept;

inline constexpr std::size_t max_feature_points = 256;

}  // namespace ringfence::narrow_phase
