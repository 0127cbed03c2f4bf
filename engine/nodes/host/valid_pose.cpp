#include "nodes/host/valid_pose.hpp"

namespace ringfence::nodes {

Status check_pose(const Pose& pose) noexcept {
  if (is_valid_pose(pose)) {
    return Status::ok;
  }
  const Quat& q = pose.orientation;
  const bool finite = detail::is_near(pose.position) && std::isfinite(q.x) && std::isfinite(q.y) &&
                      std::isfinite(q.z) && std::isfinite(q.w);
  return finite ? Status::not_unit : Status::not_finite;
}

Status make_valid(Pose& pose) noexcept {
  if (is_exact_pose(pose)) {
    return Status::ok;
  }
  if (!is_valid_pose(pose)) {
    return check_pose(pose);
  }
  Quat& q = pose.orientation;
  const double length = std::sqrt(detail::squared_norm(q));
  const double x = q.x, y = q.y, z = q.z, w = q.w;
  q = {static_cast<float>(x / length), static_cast<float>(y / length), static_cast<float>(z / length),
       static_cast<float>(w / length)};
  return Status::ok;
}

}  // namespace ringfence::nodes
