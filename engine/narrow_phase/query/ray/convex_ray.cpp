#include "narrow_phase/query/ray/convex_ray.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <span>

#include "geometry/vector.hpp"
#include "narrow_phase/query/ray/triangle_ray.hpp"

namespace ringfence::narrow_phase {
namespace {

Vec3d unit(const Vec3d& p) noexcept { return p * (1 / length(p)); }

bool is_before(const LocalRay& ray, double place) noexcept { return place < ray.begin - ray.slack; }

/// Whether the part of a line from `enter` to `leave` has a place on the ray, and the first one.
///
/// The ray starts outside. So if the line enters before the start and leaves after it, the start is on the surface, and
/// rounding moved the entry: for a line that grazes the surface or meets a sharp corner, farther than `slack`.
bool first_on_ray(const LocalRay& ray, double enter, double leave, double& place) noexcept {
  place = is_before(ray, enter) ? ray.begin : enter;
  return ray.reaches(place) && (place == enter || leave > ray.begin + ray.slack);
}

/// The interval of a ray within all slabs that were added.
struct Clip {
  double enter = -infinity, leave = infinity;
  std::size_t entered = 0;  ///< the slab that determines `enter`

  /// Keeps the half line where `at_foot` + place * `slope` <= 0.
  void add(double at_foot, double slope, std::size_t number) noexcept {
    if (slope < 0) {
      const double place = at_foot / -slope;
      if (place > enter) enter = place, entered = number;
    } else if (slope > 0) {
      const double place = -at_foot / slope;
      if (place < leave) leave = place;
    } else if (at_foot > 0) {
      leave = -infinity;
    }
  }
};

enum class Side { outside, inside };

/// A crossing of the polygon of a face by a line that comes from `side`; `none` if there is none.
double place_on_face(const LocalRay& ray, const geometry::Hull& hull, std::size_t face, Side side,
                     double none) noexcept {
  const std::span<const std::uint16_t> corners = hull.face(face);
  const Vec3d first = to_double(hull.vertex(corners[0]));
  Vec3d last = to_double(hull.vertex(corners[1]));
  for (std::size_t i = 2; i < corners.size(); ++i) {
    const Vec3d next = to_double(hull.vertex(corners[i]));
    TriangleCrossing crossing;
    if (cross_triangle(ray.foot, ray.direction, first, last, next, crossing) &&
        crossing.front == (side == Side::outside)) {
      return crossing.place;
    }
    last = next;
  }
  return none;
}

/// Where the line leaves a hull. At an edge it may cross several faces; the last place counts.
double leave_of_hull(const LocalRay& ray, const geometry::Hull& hull) noexcept {
  double leave = -infinity;
  for (std::size_t i = 0; i < hull.face_count(); ++i) {
    leave = std::max(leave, place_on_face(ray, hull, i, Side::inside, -infinity));
  }
  return leave;
}

}  // namespace

bool cast_at_sphere(const LocalRay& ray, const Vec3d& centre, double radius, LocalHit& hit) noexcept {
  const double middle = dot(centre - ray.foot, ray.direction);
  const Vec3d nearest = ray.at(middle) - centre;
  const double rest = radius * radius - dot(nearest, nearest);
  if (rest < 0) return false;
  const double half = std::sqrt(rest);
  if (!first_on_ray(ray, middle - half, middle + half, hit.place)) return false;
  hit.normal = unit(nearest - ray.direction * half);
  return true;
}

bool cast_at_box(const LocalRay& ray, const Vec3d& half, LocalHit& hit) noexcept {
  const double h[3] = {half.x, half.y, half.z}, foot[3] = {ray.foot.x, ray.foot.y, ray.foot.z};
  const double slope[3] = {ray.direction.x, ray.direction.y, ray.direction.z};
  Clip clip;
  for (std::size_t i = 0; i < 3; ++i) {
    clip.add(foot[i] - h[i], slope[i], i);
    clip.add(-foot[i] - h[i], -slope[i], i);
  }
  if (clip.enter > clip.leave || !first_on_ray(ray, clip.enter, clip.leave, hit.place)) return false;
  double normal[3] = {};
  normal[clip.entered] = slope[clip.entered] < 0 ? 1 : -1;
  hit.normal = {normal[0], normal[1], normal[2]};
  return true;
}

bool cast_at_capsule(const LocalRay& ray, double radius, double half_height, LocalHit& hit) noexcept {
  const Vec3d &p = ray.foot, &u = ray.direction;
  const double across = u.x * u.x + u.y * u.y;
  // A ray that is parallel to the axis, but for rounding, enters at an end.
  double z = u.z < 0 ? infinity : -infinity, enter = 0, leave = 0;
  if (across > 1e-30) {
    const double middle = -(p.x * u.x + p.y * u.y) / across;
    const double x = p.x + u.x * middle, y = p.y + u.y * middle;
    const double rest = radius * radius - (x * x + y * y);
    if (rest < 0) return false;
    const double half = std::sqrt(rest / across);
    enter = middle - half, leave = middle + half;
    z = p.z + u.z * enter;
  }
  if (std::abs(z) <= half_height) {
    if (!first_on_ray(ray, enter, leave, hit.place)) return false;
    // Beyond the ends of the cylinder, the ray starts behind the cap through which the line leaves, or on it.
    if (hit.place != enter && std::abs(ray.origin.z) > half_height) return false;
    hit.normal = unit({p.x + u.x * enter, p.y + u.y * enter, 0});
    return true;
  }
  return cast_at_sphere(ray, {0, 0, z > 0 ? half_height : -half_height}, radius, hit);
}

bool cast_at_hull(const LocalRay& ray, const geometry::Hull& hull, const PlaneClip& clip, LocalHit& hit) noexcept {
  if (clip.enter > clip.leave || clip.leave < ray.begin || clip.enter > ray.end + ray.slack) return false;
  // Away from edges the face that the planes say is the right one. A convex surface has only one crossing from outside.
  std::size_t face = clip.entered;
  hit.place = place_on_face(ray, hull, face, Side::outside, infinity);
  for (std::size_t i = 0; hit.place == infinity && i < hull.face_count(); ++i) {
    hit.place = place_on_face(ray, hull, face = i, Side::outside, infinity);
  }
  const double leave = is_before(ray, hit.place) ? leave_of_hull(ray, hull) : hit.place;
  if (!first_on_ray(ray, hit.place, leave, hit.place)) return false;
  hit.normal = unit(to_double(hull.normal(face)));
  return true;
}

}  // namespace ringfence::narrow_phase
