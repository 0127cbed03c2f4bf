#include "narrow_phase/query/sweep/moving_core.hpp"

#include "geometry/vector.hpp"
#include "narrow_phase/query/core_distance.hpp"

namespace ringfence::narrow_phase {

CornerBox MovingCore::box() const {
  const ConvexCore core = at({});
  const double r = core.radius();
  return {{core.support({-1, 0, 0}).x - r, core.support({0, -1, 0}).y - r, core.support({0, 0, -1}).z - r},
          {core.support({1, 0, 0}).x + r, core.support({0, 1, 0}).y + r, core.support({0, 0, 1}).z + r}};
}

Gap gap_between(const ConvexCore& fixed, const ConvexCore& moving, double limit) {
  const CoreDistance found = core_distance(fixed, moving, limit);
  Gap out;
  out.touch = found.kind == CoreDistance::Kind::touch;
  out.beyond = found.kind == CoreDistance::Kind::beyond;
  if (out.touch || out.beyond) return out;
  // Along the normal itself: the distance may be proven by another plane.
  out.normal = found.normal;
  out.width = found.along - fixed.radius() - moving.radius();
  out.on_fixed = found.on_a + out.normal * fixed.radius();
  return out;
}

Gap gap_of_ball(const Vec3d& nearest, const Vec3d& centre, double radius) noexcept {
  const Vec3d between = centre - nearest;
  const double distance = length(between);
  Gap out;
  out.touch = distance <= radius;
  if (out.touch) return out;
  out.width = distance - radius;
  out.normal = between * (1 / distance);
  out.on_fixed = nearest;
  return out;
}

}  // namespace ringfence::narrow_phase
