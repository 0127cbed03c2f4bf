#pragma once

#include <cstdint>

#include "ringfence/pose.hpp"

namespace ringfence::narrow_phase {

/// A ray or the path of a sweep: from `start` by `displacement`. Metres, world axes.
struct Ray {
  Vec3d start;
  Vec3d displacement;
  Vec3d direction;    ///< the unit vector along the displacement; zero if that is zero
  double length = 0;  ///< of the displacement

  /// Precondition: all numbers are finite, and not larger than farthest_coordinate.
  static Ray along(const Vec3d& start, const Vec3d& displacement) noexcept;
};

/// Where a ray or a sweep first touches a shape.
///
/// If it starts inside, or a swept shape overlaps or touches at its start: fraction 0, normal -direction, point the
/// start. If the displacement is zero: the same with normal 0. A mesh has no inside; a ray that starts on one of its
/// triangles hits that triangle at fraction 0.
struct ShapeHit {
  double fraction = 0;         ///< position along the displacement, 0 to 1
  Vec3d normal;                ///< unit, world axes, from the shape towards the origin of the query
  Vec3d point;                 ///< ray: start + fraction * displacement; sweep: where the surfaces touch. Metres, world
  std::uint32_t child = 0;     ///< 0: shapes have no children yet
  std::uint32_t triangle = 0;  ///< of a mesh: index into Mesh::triangles(); otherwise 0

  /// The hit of a query that starts inside, or that has no displacement.
  static ShapeHit at_start(const Ray& ray) noexcept {
    const Vec3d& d = ray.direction;
    return {0, ray.length > 0 ? Vec3d{-d.x, -d.y, -d.z} : Vec3d{}, ray.start, 0, 0};
  }
};

/// The point of a shape that is nearest to a given point.
struct NearestPoint {
  double distance = 0;  ///< metres; 0 if the given point is inside
  Vec3d point;          ///< on the shape, metres, world axes; the given point itself if that is inside
  std::uint32_t child = 0;
  std::uint32_t triangle = 0;  ///< as in ShapeHit
};

}  // namespace ringfence::narrow_phase
