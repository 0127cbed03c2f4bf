#include "reference/exact_contact.hpp"

#include <algorithm>

#include "reference/core_distance.hpp"
#include "reference/primitives.hpp"
#include "reference/separation.hpp"

namespace ringfence::reference {
namespace {

struct PrimitiveContact {
  Separation separation;  // normal and point in the frame of a
  Vector point;
};

/// The point midway between the surfaces. When b is moved out along the normal by slightly more than the depth, there
/// is one shortest connection between the shapes. It starts on a and, moved back with b, ends on b.
PrimitiveContact contact_of(const Core& a, const Core& b, const Placement& b_in_a) {
  PrimitiveContact out{separation(a, b, b_in_a), {}};
  const Vector n(out.separation.normal);
  const double core_depth = -out.separation.distance - a.radius - b.radius;
  const double hair = (a.function || b.function ? 1e-4 : 1e-9) * (a.reach + b.reach);
  const double shift = std::max(0.0, core_depth) + hair;
  const Placement moved{b_in_a.rotation, b_in_a.offset + n * shift};
  const CoreDistance apart = gjk_distance({a, b, moved}, hair * 1e-3);
  const Vector on_a = apart.on_a + n * a.radius, on_b = apart.on_b - n * (shift + b.radius);
  out.point = (on_a + on_b) * 0.5;
  return out;
}

}  // namespace

Vec3f arm(const Vec3d& point, const Pose& pose) {
  const Vector d = Vector(point) - Vector(pose.position);
  return {static_cast<float>(d.x), static_cast<float>(d.y), static_cast<float>(d.z)};
}

std::optional<Contact> exact_contact(const PreparedShape& a, const Pose& pose_a, const PreparedShape& b,
                                     const Pose& pose_b) {
  const Placement b_in_a = relative(pose_a, pose_b);
  std::optional<PrimitiveContact> deepest;
  double depth = 0;
  for_each_primitive_pair(a, b, b_in_a, 0, [&](const Core& p, const Core& q) {
    const double found = -separation(p, q, b_in_a).distance;
    if (found >= depth) depth = found, deepest = contact_of(p, q, b_in_a);
    return depth;
  });
  if (!deepest) return std::nullopt;

  const Rotation turn = rotation_of(pose_a.orientation);
  const Vector n = turn * Vector(deepest->separation.normal);
  Contact out;
  out.depth = static_cast<float>(depth);
  out.normal = {static_cast<float>(n.x), static_cast<float>(n.y), static_cast<float>(n.z)};
  out.point = turn * deepest->point + Vector(pose_a.position);
  out.arm_a = arm(out.point, pose_a);
  out.arm_b = arm(out.point, pose_b);
  return out;
}

}  // namespace ringfence::reference
