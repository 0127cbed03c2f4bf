#include "narrow_phase/support/cutting_planes.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include "geometry/vector.hpp"

namespace ringfence::narrow_phase {
namespace {

/// A linear function of the direction (x, y): slope_x x + slope_y y + level.
struct Plane {
  double slope_x, slope_y, level;
};

Plane operator-(const Plane& p, const Plane& q) {
  return {p.slope_x - q.slope_x, p.slope_y - q.slope_y, p.level - q.level};
}

/// The point so far at which the highest of the planes is lowest.
struct Lowest {
  const Plane* planes;
  std::size_t count;
  double most;
  double x = 0, y = 0;
  double height = std::numeric_limits<double>::infinity();

  /// Planes that do not intersect give a point that is not finite; it is ignored.
  void consider(double at_x, double at_y) {
    if (!(std::abs(at_x) <= most) || !(std::abs(at_y) <= most)) return;
    double highest = -std::numeric_limits<double>::infinity();
    for (std::size_t i = 0; i < count && highest < height; ++i) {
      highest = std::max(highest, planes[i].slope_x * at_x + planes[i].slope_y * at_y + planes[i].level);
    }
    if (highest < height) {
      height = highest;
      x = at_x;
      y = at_y;
    }
  }
};

}  // namespace

void CuttingPlanes::add(const Vec3d& support) { points_[added_++ % kept] = support; }

// A linear program in the plane. It is so small that all its vertices are tried: those of the bounds, of two planes
// with a bound, and of three planes.
Vec3d CuttingPlanes::lowest(const Vec3d& n, const Vec3d& u, const Vec3d& v, double most) const {
  const std::size_t count = std::min(added_, kept);
  if (count == 0) return n;
  std::array<Plane, kept> planes;
  for (std::size_t i = 0; i < count; ++i) planes[i] = {dot(points_[i], u), dot(points_[i], v), dot(points_[i], n)};
  Lowest found{planes.data(), count, most};
  for (const double x : {-most, most}) {
    for (const double y : {-most, most}) found.consider(x, y);
  }
  for (std::size_t i = 0; i < count; ++i) {
    for (std::size_t j = 0; j < i; ++j) {
      const Plane p = planes[i] - planes[j];
      for (const double bound : {-most, most}) {
        found.consider(bound, -(p.level + p.slope_x * bound) / p.slope_y);
        found.consider(-(p.level + p.slope_y * bound) / p.slope_x, bound);
      }
      for (std::size_t k = 0; k < j; ++k) {
        const Plane q = planes[i] - planes[k];
        const double area = p.slope_x * q.slope_y - p.slope_y * q.slope_x;
        found.consider((p.slope_y * q.level - p.level * q.slope_y) / area,
                       (p.level * q.slope_x - p.slope_x * q.level) / area);
      }
    }
  }
  return n + u * found.x + v * found.y;
}

}  // namespace ringfence::narrow_phase
