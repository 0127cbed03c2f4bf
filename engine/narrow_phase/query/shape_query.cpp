#include "narrow_phase/query/shape_query.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include "geometry/vector.hpp"
#include "narrow_phase/query/nearest/convex_nearest.hpp"
#include "narrow_phase/query/nearest/mesh_nearest.hpp"
#include "narrow_phase/query/ray/convex_ray.hpp"
#include "narrow_phase/query/ray/mesh_ray.hpp"
#include "narrow_phase/query/sweep/convex_sweep.hpp"

namespace ringfence::narrow_phase {
namespace {

/// The length of any finite vector, without overflow or underflow of squares.
double safe_length(const Vec3d& p) noexcept {
  const double most = std::max({std::abs(p.x), std::abs(p.y), std::abs(p.z)});
  if (!(most > 0)) return 0;
  return most * length(Vec3d{p.x / most, p.y / most, p.z / most});
}

/// Whether the point, on the mesh's axes, is on the surface but for rounding.
bool is_on_mesh(const geometry::Mesh& mesh, const Vec3d& point, std::uint32_t& triangle) {
  Vec3d nearest;
  double distance = 0;
  const double rounding = 0x1p-46 * (double{mesh.bounding_radius()} + length(point));
  return nearest_in_mesh(mesh, point, rounding, nearest, distance, triangle);
}

/// Whether the shape contains the start. A mesh has no inside: then whether a ray without a length is on its surface.
bool starts_inside(const geometry::ShapeView& shapes, ShapeNumber shape, const LocalRay& ray, const PlaneClip& clip,
                   std::uint32_t& triangle) {
  const geometry::ShapeRow& row = shapes.row(shape);
  switch (row.kind) {
    case ShapeKind::hull:
      return hull_contains(shapes, shape, ray.origin, clip.farthest);
    case ShapeKind::mesh:
      return ray.length == 0 && is_on_mesh(shapes.mesh(row.index_in_kind), ray.origin, triangle);
    default:
      return contains(shapes, shape, ray.origin);
  }
}

/// A ray that starts outside. `clip`: of a hull. Where it saves time, hits beyond `limit_place` are not searched.
bool cast_from_outside(const geometry::ShapeView& shapes, ShapeNumber shape, const LocalRay& ray, const PlaneClip& clip,
                       double limit_place, LocalHit& found, std::uint32_t& triangle) {
  const geometry::ShapeRow& row = shapes.row(shape);
  const double size[3] = {double{row.size[0]}, double{row.size[1]}, double{row.size[2]}};
  switch (row.kind) {
    case ShapeKind::sphere:
      return cast_at_sphere(ray, {}, size[0], found);
    case ShapeKind::box:
      return cast_at_box(ray, {size[0], size[1], size[2]}, found);
    case ShapeKind::capsule:
      return cast_at_capsule(ray, size[0], size[1], found);
    case ShapeKind::hull:
      return cast_at_hull(ray, shapes.hull(row.index_in_kind), clip, found);
    case ShapeKind::support: {
      const SweepContact contact = cast_at_support(shapes, shape, ray, limit_place);
      found = {contact.place, contact.normal};
      return contact.kind == SweepContact::Kind::touch;
    }
    case ShapeKind::mesh:
      return cast_at_mesh(ray, shapes.mesh(row.index_in_kind), limit_place, found, triangle);
  }
  return false;
}

/// A ray whose line meets the ball around the shape. `rotation()`: from the axes of the shape to the world's.
template <class Rotation>
bool cast_on_axes(const geometry::ShapeView& shapes, ShapeNumber shape, const LocalRay& local, const Rotation& rotation,
                  const Ray& ray, double limit, ShapeHit& hit) {
  const geometry::ShapeRow& row = shapes.row(shape);
  std::uint32_t triangle = 0;
  PlaneClip clip;
  if (row.kind == ShapeKind::hull) {
    clip = clip_by_planes(shapes.hull(row.index_in_kind), local, 0x1p-40 * double{row.bounding_radius});
  }
  if (starts_inside(shapes, shape, local, clip, triangle)) {
    hit = ShapeHit::at_start(ray);
    hit.triangle = triangle;
    return true;
  }
  if (ray.length == 0) return false;
  LocalHit found;
  const double limit_place = local.place_of(limit);
  if (!cast_from_outside(shapes, shape, local, clip, limit_place, found, triangle)) return false;
  const double fraction = local.fraction_of(found.place);
  if (fraction > limit) return false;
  hit = {};
  hit.fraction = fraction;
  hit.normal = geometry::rotate(rotation(), found.normal);
  hit.point = ray.start + ray.displacement * fraction;
  hit.triangle = triangle;
  return true;
}

/// The nearest point of a shape to `local`, on its axes. `rotation()`: from these to the world's.
template <class Rotation>
bool find_on_axes(const geometry::ShapeView& shapes, ShapeNumber shape, const Vec3d& local, const Rotation& rotation,
                  const Vec3d& position, const Vec3d& point, double limit, NearestPoint& nearest) {
  const geometry::ShapeRow& row = shapes.row(shape);
  NearestPoint out;
  Vec3d place;
  if (row.kind == ShapeKind::mesh) {
    if (!nearest_in_mesh(shapes.mesh(row.index_in_kind), local, limit, place, out.distance, out.triangle)) return false;
  } else {
    place = nearest_in_convex(shapes, shape, local);
    out.distance = length(place - local);
    if (!(out.distance <= limit)) return false;
  }
  out.point = place == local ? point : position + geometry::rotate(rotation(), place);
  nearest = out;
  return true;
}

}  // namespace

Ray Ray::along(const Vec3d& start, const Vec3d& displacement) noexcept {
  Ray ray{start, displacement, {}, safe_length(displacement)};
  if (ray.length > 0) {
    const Vec3d& d = displacement;
    ray.direction = {d.x / ray.length, d.y / ray.length, d.z / ray.length};
  }
  return ray;
}

bool cast_ray(const geometry::ShapeView& shapes, ShapeNumber shape, const Pose& pose, const Ray& ray, double limit,
              ShapeHit& hit) {
  const double size = double{shapes.row(shape).bounding_radius};
  const geometry::RotationD rotation = geometry::rotation_exact(pose.orientation);
  const LocalRay local(ray, pose.position, rotation, size);
  return !local.misses_ball(size) && cast_on_axes(
                                         shapes, shape, local, [&] { return rotation; }, ray, limit, hit);
}

bool cast_ray(const geometry::ShapeView& shapes, ShapeNumber shape, const PlacedRays& placed, std::size_t i,
              const Ray& ray, double limit, ShapeHit& hit) {
  return !placed.misses(i) && cast_on_axes(
                                  shapes, shape, placed.ray(i), [&] { return placed.rotation(i); }, ray, limit, hit);
}

bool find_nearest(const geometry::ShapeView& shapes, ShapeNumber shape, const Pose& pose, const Vec3d& point,
                  double limit, NearestPoint& nearest) {
  const geometry::RotationD rotation = geometry::rotation_exact(pose.orientation);
  const Vec3d local = geometry::rotate_inverse(rotation, point - pose.position);
  return find_on_axes(
      shapes, shape, local, [&] { return rotation; }, pose.position, point, limit, nearest);
}

bool find_nearest(const geometry::ShapeView& shapes, ShapeNumber shape, const PlacedRays& placed, std::size_t i,
                  const Vec3d& point, double limit, NearestPoint& nearest) {
  return find_on_axes(
      shapes, shape, placed.ray(i).origin, [&] { return placed.rotation(i); }, placed.pose(i).position, point, limit,
      nearest);
}

}  // namespace ringfence::narrow_phase
