#pragma once

#include <cmath>

#include "ringfence/pose.hpp"
#include "ringfence/status.hpp"

namespace ringfence::nodes {

namespace detail {

/// False for NaN.
inline bool is_near(const Vec3d& p) noexcept {
  return std::abs(p.x) <= farthest_coordinate && std::abs(p.y) <= farthest_coordinate &&
         std::abs(p.z) <= farthest_coordinate;
}
inline double squared_norm(const Quat& q) noexcept {
  const double x = q.x, y = q.y, z = q.z, w = q.w;
  return x * x + y * y + z * z + w * w;
}

}  // namespace detail

/// Whether make_valid() accepts a pose and does not change it: the squared norm of a unit quaternion rounded to four
/// floats is within 2.4e-7 of 1. Any thread may call it.
inline bool is_exact_pose(const Pose& pose) noexcept {
  return std::abs(detail::squared_norm(pose.orientation) - 1.0) <= 1e-6 && detail::is_near(pose.position);
}

/// Whether make_valid() accepts a pose. Fast enough for every record of a message. Any thread may call it.
inline bool is_valid_pose(const Pose& pose) noexcept {
  // Also false for an orientation that is not finite.
  const bool is_unit = std::abs(detail::squared_norm(pose.orientation) - 1.0) <= 2.001e-3;
  return is_unit && detail::is_near(pose.position);
}

/// The result that make_valid() would return. Any thread may call it.
Status check_pose(const Pose& pose) noexcept;

/// Checks a pose, and normalises its orientation if its length differs from 1 by more than rounding. Returns ok,
/// not_finite (also for a position beyond farthest_coordinate), or not_unit (the length differs from 1 by more than
/// about 10^-3). Changes `pose` only if it returns ok. Idempotent: a second call accepts the pose and does not change
/// it. Any thread may call it.
Status make_valid(Pose& pose) noexcept;

}  // namespace ringfence::nodes
