#include "reference/query_check.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>

#include "reference/core_distance.hpp"
#include "reference/separation.hpp"
#include "reference/surface_crossing.hpp"
#include "reference/text.hpp"
#include "reference/vector.hpp"

namespace ringfence::reference {
namespace {

Vector minus(const Vec3d& p, const Vec3d& q) { return Vector(p) - Vector(q); }

/// A motion in the frame of a shape.
struct LocalMotion {
  Placement start;
  Vector displacement;

  LocalMotion(const Pose& pose, const Motion& motion)
      : start(relative(pose, motion.start)),
        displacement(rotation_of(pose.orientation).inverse(Vector(motion.displacement))) {}

  Placement at(double fraction) const { return {start.rotation, start.offset + displacement * fraction}; }
};

/// The distance of a core from a moving one is a convex function of the fraction, since both are convex, and changes no
/// faster than the motion.
class Approach {
 public:
  Approach(const Core& fixed, const Core& moving, const LocalMotion& motion)
      : fixed_(fixed), moving_(moving), motion_(motion), speed_(length(motion.displacement)) {}

  /// Negative: minus the depth.
  double distance(double fraction) const { return separation(fixed_, moving_, motion_.at(fraction)).distance; }

  /// The least distance from fraction 0 to `until`, but for a quarter of `allowed`; any value above -allowed / 2 if the
  /// least distance is not below that. Golden section.
  double least(double until, double allowed) const {
    constexpr double part = 0.6180339887498949;
    double low = 0, high = until;
    double p = high - part * (high - low), q = low + part * (high - low);
    double at_p = distance(p), at_q = distance(q), best = std::min({distance(0), distance(until), at_p, at_q});
    while ((high - low) * speed_ > allowed / 4 && best - (high - low) * speed_ < -allowed / 2) {
      if (at_p < at_q) {
        high = q, q = p, at_q = at_p;
        best = std::min(best, at_p = distance(p = high - part * (high - low)));
      } else {
        low = p, p = q, at_p = at_q;
        best = std::min(best, at_q = distance(q = low + part * (high - low)));
      }
    }
    return best;
  }

  /// How far the plane with this normal, from the fixed core to the moving one, is from separating them.
  double overlap(const Vector& normal, double fraction) const {
    return CorePair{fixed_, moving_, motion_.at(fraction)}.overlap(normal) + fixed_.radius + moving_.radius;
  }

 private:
  const Core& fixed_;
  const Core& moving_;
  const LocalMotion& motion_;
  double speed_;
};

Extents path_of(const PreparedShape& shape, const LocalMotion& motion) {
  Extents out = extents_of(shape, motion.at(0));
  const Extents end = extents_of(shape, motion.at(1));
  include(out, end.lower), include(out, end.upper);
  return out;
}

bool are_apart(const Extents& p, const Extents& q, double reach) {
  const Vector d{std::max(p.lower.x - q.upper.x, q.lower.x - p.upper.x),
                 std::max(p.lower.y - q.upper.y, q.lower.y - p.upper.y),
                 std::max(p.lower.z - q.upper.z, q.lower.z - p.upper.z)};
  return std::max({d.x, d.y, d.z}) > reach;
}

/// Calls `visit(core)` for the convex shape, or for each triangle whose box comes within `reach` of `box`.
template <class Visit>
void for_each_core(const PreparedShape& shape, const Extents& box, double reach, const Visit& visit) {
  if (shape.kind != ShapeKind::mesh) return visit(shape.core);
  Core core;
  const Surface& surface = shape.surface;
  for (std::size_t i = 0; i < surface.triangles.size(); ++i) {
    if (i % Surface::run_length == 0 && are_apart(surface.runs[i / Surface::run_length], box, reach)) {
      i += Surface::run_length - 1;
      continue;
    }
    const auto& c = surface.triangles[i].corners;
    Extents of_triangle{c[0], c[0]};
    include(of_triangle, c[1]), include(of_triangle, c[2]);
    if (are_apart(of_triangle, box, reach)) continue;
    set_triangle(core, c[0], c[1], c[2]);
    visit(core);
  }
}

/// Whether the ray, and all rays around it, cross the mesh before a fraction.
bool surely_crosses(const Surface& surface, const LocalMotion& ray, double before, double allowed) {
  const Vector d = ray.displacement, u = normalised(d), p = perpendicular(u), q = cross(u, p);
  for (int i = 0; i < 9; ++i) {
    const double angle = i * 0.7853981633974483, off = i == 8 ? 0 : allowed;
    const Vector start = ray.start.offset + (p * std::cos(angle) + q * std::sin(angle)) * off;
    const auto crossing = first_crossing(surface, start, start + d);
    if (!crossing || *crossing > before) return false;
  }
  return true;
}

/// The distance of a point (relative to the position of `pose`, world axes) from a shape; 0 inside.
double outside(const PreparedShape& shape, const Pose& pose, const Vector& place) {
  const Pose at_origin{{}, pose.orientation}, at_place{place, {}};
  return std::max(0.0, separation(shape, at_origin, point_shape(), at_place).distance);
}

bool is_start(const Motion& motion, const ClaimedHit& hit) {
  const Vector d(motion.displacement);
  const double speed = length(d);
  const Vector normal = speed > 0 ? d * (-1 / speed) : Vector();
  return hit.fraction == 0 && length(Vector(hit.normal) - normal) < 1e-6 && hit.point == motion.start.position;
}

/// Errors of normal and point. `distances` of the cores have been checked.
std::string describe_surface_error(const PreparedShape& shape, const Pose& pose, const Motion& motion,
                                   const ClaimedHit& hit, double least_overlap, double allowed) {
  const Vector n(hit.normal), d(motion.displacement);
  if (std::abs(length(n) - 1) > 1e-9) return text("the normal has length %.12g", length(n));
  if (dot(n, d) > 1e-6 * length(d)) return text("the normal points along the motion: %.3g", dot(n, d) / length(d));
  if (least_overlap > allowed) return text("wrong normal: its plane is %.3g m from separating", least_overlap);
  const double from_shape = outside(shape, pose, minus(hit.point, pose.position));
  if (from_shape > allowed) return text("wrong point: %.3g m from the shape", from_shape);
  const Vector moved = minus(hit.point, motion.start.position) - d * hit.fraction;
  const double from_moving = outside(motion.shape, motion.start, moved);
  if (from_moving > allowed) return text("wrong point: %.3g m from the moving shape", from_moving);
  return {};
}

}  // namespace

const PreparedShape& point_shape() {
  static const Shapes shapes = [] {
    const ShapeDescription point = Sphere{0};
    return Shapes({&point, 1});
  }();
  return shapes[0];
}

std::string describe_hit_error(const PreparedShape& shape, const Pose& pose, const Motion& motion,
                               const ClaimedHit* claimed, double allowed) {
  const LocalMotion local(pose, motion);
  const double until = claimed ? claimed->fraction : 1;
  if (!(until >= 0 && until <= 1)) return text("the fraction is %.12g", until);
  const Vector normal = claimed ? rotation_of(pose.orientation).inverse(Vector(claimed->normal)) : Vector();
  double least_before = infinity, at_contact = infinity, overlap = infinity;
  for_each_core(shape, path_of(motion.shape, local), allowed, [&](const Core& core) {
    const Approach approach(core, motion.shape.core, local);
    least_before = std::min(least_before, approach.least(until, allowed));
    if (!claimed) return;
    const double distance = approach.distance(until);
    at_contact = std::min(at_contact, distance);
    if (distance <= allowed) overlap = std::min(overlap, approach.overlap(normal, until));
  });
  if (claimed && at_contact > allowed) return text("extra at %.12g: %.3g m apart", until, at_contact);
  if (claimed && is_start(motion, *claimed)) return {};
  if (least_before < -allowed) return text("missing before %.12g: depth %.3g m", until, -least_before);
  const double speed = length(local.displacement);
  if (shape.kind == ShapeKind::mesh && &motion.shape == &point_shape() && speed > 0 &&
      surely_crosses(shape.surface, local, claimed ? until - allowed / speed : 1, allowed)) {
    return text("missing before %.12g", until);
  }
  return claimed ? describe_surface_error(shape, pose, motion, *claimed, overlap, allowed) : std::string();
}

std::string describe_overlap_error(const PreparedShape& shape, const Pose& pose, const PreparedShape& other,
                                   const Pose& other_pose, bool claimed, double allowed) {
  const Separation found = separation(shape, pose, other, other_pose, 2 * allowed);
  if (claimed && found.distance > allowed) return text("extra: %.3g m apart", found.distance);
  if (!claimed && found.distance < -allowed) return text("missing: depth %.3g m", -found.distance);
  return {};
}

std::string describe_nearest_error(const PreparedShape& shape, const Pose& pose, const Vec3d& point, double limit,
                                   const ClaimedPoint* claimed, double allowed) {
  const double exact = outside(shape, pose, minus(point, pose.position));
  if (!claimed) {
    return exact < limit - allowed ? text("missing: distance %.12g m", exact) : std::string();
  }
  if (std::abs(claimed->distance - exact) > allowed) {
    return text("distance %.12g m instead of %.12g m", claimed->distance, exact);
  }
  if (claimed->distance > limit) return text("distance %.12g m is beyond the limit", exact);
  const double off = outside(shape, pose, minus(claimed->point, pose.position));
  if (off > allowed) return text("the point is %.3g m from the shape", off);
  const double between = length(minus(claimed->point, point));
  if (std::abs(between - exact) > allowed) return text("the point is %.12g m away, not %.12g m", between, exact);
  return {};
}

}  // namespace ringfence::reference
