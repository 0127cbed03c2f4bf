#include "reference/separation.hpp"

#include "reference/core_distance.hpp"
#include "reference/core_overlap.hpp"
#include "reference/primitives.hpp"

namespace ringfence::reference {
namespace {

/// Signed distance of two cores, without their radii.
struct CoreSeparation {
  double distance;
  Vector normal;
  double error;
};

CoreSeparation from_points(const CoreDistance& d) { return {d.upper, normalised(d.on_b - d.on_a), d.upper - d.lower}; }

CoreSeparation polytope_separation(const CorePair& pair) {
  const double tolerance = 1e-12 * pair.scale();
  const CoreDistance apart = gjk_distance(pair, tolerance);
  if (apart.converged && apart.upper > tolerance) return from_points(apart);
  const CoreOverlap overlap = polytope_overlap(pair);
  if (overlap.depth < -tolerance) return from_points(exhaustive_distance(pair));
  return {-overlap.depth, overlap.normal, tolerance};
}

/// For pairs with a support function, which returns floats: a finer tolerance would be meaningless.
CoreSeparation function_separation(const CorePair& pair) {
  const double tolerance = 1e-6 * pair.scale();
  const CoreDistance apart = gjk_distance(pair, tolerance);
  if (apart.lower > 2 * tolerance) {
    CoreSeparation out = from_points(apart);
    out.error += tolerance;
    return out;
  }
  const CoreOverlap overlap = epa_overlap(pair, tolerance);
  return {-overlap.depth, overlap.normal, overlap.error + tolerance};
}

}  // namespace

Separation separation(const Core& a, const Core& b, const Placement& b_in_a) {
  const CorePair pair{a, b, b_in_a};
  const CoreSeparation core = a.function || b.function ? function_separation(pair) : polytope_separation(pair);
  return {core.distance - a.radius - b.radius, core.normal, core.error};
}

Separation separation(const PreparedShape& a, const Pose& pose_a, const PreparedShape& b, const Pose& pose_b,
                      double reach) {
  const Placement b_in_a = relative(pose_a, pose_b);
  Separation best;
  if (a.kind != ShapeKind::mesh && b.kind != ShapeKind::mesh) {
    best = separation(a.core, b.core, b_in_a);
  } else {
    best.distance = reach;
    for_each_primitive_pair(a, b, b_in_a, reach, [&](const Core& p, const Core& q) {
      const Separation s = separation(p, q, b_in_a);
      if (s.distance < best.distance) best = s;
      return -best.distance;
    });
  }
  best.normal = rotation_of(pose_a.orientation) * Vector(best.normal);
  return best;
}

}  // namespace ringfence::reference
