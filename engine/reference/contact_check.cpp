#include "reference/contact_check.hpp"

#include <algorithm>
#include <cmath>

#include "reference/core_distance.hpp"
#include "reference/primitives.hpp"
#include "reference/separation.hpp"
#include "reference/text.hpp"

namespace ringfence::reference {
namespace {

/// A reported contact, in the frame of a.
struct Claim {
  double depth;
  Vector normal;
  Vector point;
  double rounding;  ///< how far the point may be from where it was computed, because its coordinates are doubles
};

/// A proven lower bound of the distance of a point from a core, in the frame of the core.
double at_least_outside(const Core& core, const Vector& place) {
  static const Core point = box_core({});
  return gjk_distance({core, point, {{}, place}}, 1e-9 * core.reach).lower - core.radius;
}

/// Why the normal and the point of a contact are not those of a deepest contact of the two cores. Empty if they are.
std::string describe_geometry_error(const Core& a, const Core& b, const Placement& b_in_a, const Claim& claim,
                                    double allowed) {
  const Vector& n = claim.normal;
  const double end_of_a = a.extent(n) + a.radius;
  const double start_of_b = dot(n, b_in_a.offset) - b.extent(b_in_a.rotation.inverse(-n)) - b.radius;
  const double overlap = end_of_a - start_of_b;
  if (overlap > claim.depth + allowed) {
    return text("wrong normal: b must move %.9g m along it, not %.9g m", overlap, claim.depth);
  }
  const double off = dot(n, claim.point) - (end_of_a + start_of_b) / 2;
  if (std::abs(off) > allowed + claim.rounding) return text("wrong point: %.3g m along the normal from midway", off);

  const double within = std::max(0.0, overlap / 2) + allowed + claim.rounding;
  const double from_a = at_least_outside(a, claim.point), from_b = at_least_outside(b, inverse(b_in_a) * claim.point);
  if (from_a > within) return text("wrong point: %.9g m outside a, overlap %.9g m", from_a, overlap);
  if (from_b > within) return text("wrong point: %.9g m outside b, overlap %.9g m", from_b, overlap);
  return {};
}

/// Depth and normal are floats. Where a small object touches a huge one, this limits how precise they can be.
double rounding_to_float(const PreparedShape& a, const PreparedShape& b) {
  return 0x1p-22 * (a.bounding_radius + b.bounding_radius);
}

bool is_finite(const Contact& c) {
  return std::isfinite(c.depth) && std::isfinite(c.normal.x) && std::isfinite(c.normal.y) &&
         std::isfinite(c.normal.z) && std::isfinite(c.point.x) && std::isfinite(c.point.y) && std::isfinite(c.point.z);
}

}  // namespace

double band(const PreparedShape& a, const PreparedShape& b, const Tolerance& tolerance) {
  const auto [smaller, larger] = std::minmax(a.bounding_radius, b.bounding_radius);
  return std::max({tolerance.relative * smaller, tolerance.of_larger * larger, tolerance.least});
}

std::string describe_error(const PreparedShape& a, const Pose& pose_a, const PreparedShape& b, const Pose& pose_b,
                           const Contact* claimed, const Tolerance& tolerance) {
  const double width = band(a, b, tolerance);
  const Separation exact = separation(a, pose_a, b, pose_b, 2 * width);
  double allowed = width + exact.error;
  const double depth = std::max(0.0, -exact.distance);
  if (!claimed) return -exact.distance > allowed ? text("missing: depth %.9g m", depth) : std::string();
  if (exact.distance > allowed) return text("extra: the two are %.9g m apart, or more", exact.distance);
  if (!is_finite(*claimed)) return "depth, normal or point is not finite";
  if (claimed->depth < 0) return text("depth is negative: %.9g m", static_cast<double>(claimed->depth));

  allowed += rounding_to_float(a, b);
  const Vector normal(claimed->normal);
  if (std::abs(length(normal) - 1) > tolerance.unit_length) return text("normal has length %.9g", length(normal));
  if (std::abs(claimed->depth - depth) > allowed) {
    return text("wrong depth: %.9g m, the least is %.9g m (band %.3g m)", static_cast<double>(claimed->depth), depth,
                allowed);
  }
  const Rotation turn_a = rotation_of(pose_a.orientation);
  const Claim claim{claimed->depth, turn_a.inverse(normalised(normal)),
                    turn_a.inverse(Vector(claimed->point) - Vector(pose_a.position)),
                    0x1p-53 * length(Vector(claimed->point))};
  const Placement b_in_a = relative(pose_a, pose_b);
  if (a.kind != ShapeKind::mesh && b.kind != ShapeKind::mesh) {
    return describe_geometry_error(a.core, b.core, b_in_a, claim, allowed);
  }
  // Within the tolerance several pairs of primitives can be as deep as the deepest: one that matches is enough.
  bool right = false;
  std::string first_wrong;
  const double least_depth = -exact.distance - 2 * allowed;
  for_each_primitive_pair(a, b, b_in_a, 2 * allowed, [&](const Core& p, const Core& q) {
    if (right || -separation(p, q, b_in_a).distance < least_depth) return least_depth;
    const std::string wrong = describe_geometry_error(p, q, b_in_a, claim, allowed);
    right = wrong.empty();
    if (first_wrong.empty()) first_wrong = wrong;
    return least_depth;
  });
  return right ? std::string() : first_wrong;
}

std::pair<double, double> depth_bounds(const PreparedShape& a, const Pose& pose_a, const PreparedShape& b,
                                       const Pose& pose_b, const Tolerance& tolerance) {
  const double width = band(a, b, tolerance);
  const Separation exact = separation(a, pose_a, b, pose_b, 2 * width);
  const double allowed = width + exact.error + rounding_to_float(a, b);
  return {-exact.distance - allowed, -exact.distance + allowed};
}

}  // namespace ringfence::reference
