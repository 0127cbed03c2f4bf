#include <limits>

#include "geometry/vector.hpp"
#include "narrow_phase/query/core_distance.hpp"
#include "narrow_phase/query/nearest/convex_nearest.hpp"
#include "narrow_phase/query/overlap_tests.hpp"
#include "narrow_phase/query/shape_pair.hpp"
#include "narrow_phase/query/shape_query.hpp"
#include "narrow_phase/query/sweep/convex_sweep.hpp"
#include "narrow_phase/query/sweep/mesh_sweep.hpp"

namespace ringfence::narrow_phase {
namespace {

/// From the axes of a shape with orientation `q` to those of `frame`.
geometry::RotationD relative_rotation(const geometry::RotationD& frame, Quat q) noexcept {
  const geometry::RotationD own = geometry::rotation_exact(q);
  geometry::RotationD out;
  for (int i = 0; i < 3; ++i) {
    for (int j = 0; j < 3; ++j) {
      out.m[i][j] = (frame.m[0][i] * own.m[0][j] + frame.m[1][i] * own.m[1][j]) + frame.m[2][i] * own.m[2][j];
    }
  }
  return out;
}

/// The query's shape on the axes of a shape. `frame()`: the rotation of these axes.
template <class Rotation>
MovingCore core_on_axes(const Rotation& frame, const QueryShape& query) noexcept {
  const bool is_ball = query.shapes.row(query.shape).kind == ShapeKind::sphere;
  return {query.shapes, query.shape, is_ball ? Placement{}.rotation : relative_rotation(frame(), query.orientation)};
}

/// One of the two is a support function.
bool overlaps_convex(const geometry::ShapeView& shapes, ShapeNumber shape, const MovingCore& query,
                     const Vec3d& position) {
  if (query.is_sphere()) {
    return gap_of_ball(nearest_in_convex(shapes, shape, position), position, query.radius()).touch;
  }
  return core_distance(ConvexCore(shapes, shape, {}), query.at(position), 0).kind == CoreDistance::Kind::touch;
}

/// A path whose line meets the ball around both shapes. `rotation()`: from the axes of the shape to the world's.
template <class Rotation>
bool sweep_on_axes(const geometry::ShapeView& shapes, ShapeNumber shape, const LocalRay& local,
                   const Rotation& rotation, const Vec3d& position, const QueryShape& moving, const Ray& path,
                   double limit, ShapeHit& hit) {
  const geometry::ShapeRow& row = shapes.row(shape);
  const MovingCore core = core_on_axes(rotation, moving);
  std::uint32_t triangle = 0;
  const SweepContact found =
      row.kind == ShapeKind::mesh
          ? sweep_at_mesh(shapes.mesh(row.index_in_kind), core, local, local.place_of(limit), triangle)
          : sweep_at_convex(shapes, shape, core, local, local.place_of(limit));
  if (found.kind == SweepContact::Kind::none) return false;
  const double fraction = local.fraction_of(found.place);
  if (fraction > limit) return false;
  hit = ShapeHit::at_start(path);
  hit.triangle = triangle;
  if (found.kind == SweepContact::Kind::inside) return true;
  const geometry::RotationD turn = rotation();
  hit.fraction = fraction;
  hit.normal = geometry::rotate(turn, found.normal);
  hit.point = position + geometry::rotate(turn, found.point);
  return true;
}

}  // namespace

bool overlaps(const geometry::ShapeView& shapes, ShapeNumber shape, const Pose& pose, const QueryShape& query,
              const Vec3d& position, std::uint32_t& triangle) {
  const geometry::ShapeRow& row = shapes.row(shape);
  triangle = 0;
  if (OverlapTests::tests(row.kind) && OverlapTests::tests(query.shapes.row(query.shape).kind)) {
    return ShapePair(shapes, shape, query.shapes, query.shape).contact(pose, {position, query.orientation}).has_value();
  }
  const geometry::RotationD rotation = geometry::rotation_exact(pose.orientation);
  const MovingCore core = core_on_axes([&] { return rotation; }, query);
  const Vec3d local = geometry::rotate_inverse(rotation, position - pose.position);
  const double sizes = (double{row.bounding_radius} + core.size()) * (1 + 0x1p-20);
  if (dot(local, local) > sizes * sizes) return false;
  return row.kind == ShapeKind::mesh ? overlaps_mesh(shapes.mesh(row.index_in_kind), core, local, triangle)
                                     : overlaps_convex(shapes, shape, core, local);
}

bool sweep_shape(const geometry::ShapeView& shapes, ShapeNumber shape, const Pose& pose, const QueryShape& moving,
                 const Ray& path, double limit, ShapeHit& hit) {
  if (path.length == 0) {
    std::uint32_t triangle = 0;
    if (!overlaps(shapes, shape, pose, moving, path.start, triangle)) return false;
    hit = ShapeHit::at_start(path);
    hit.triangle = triangle;
    return true;
  }
  const double sizes =
      double{shapes.row(shape).bounding_radius} + double{moving.shapes.row(moving.shape).bounding_radius};
  const geometry::RotationD rotation = geometry::rotation_exact(pose.orientation);
  const LocalRay local(path, pose.position, rotation, sizes);
  return !local.misses_ball(sizes) &&
         sweep_on_axes(
             shapes, shape, local, [&] { return rotation; }, pose.position, moving, path, limit, hit);
}

bool sweep_shape(const geometry::ShapeView& shapes, ShapeNumber shape, const PlacedRays& placed, std::size_t i,
                 const QueryShape& moving, const Ray& path, double limit, ShapeHit& hit) {
  if (path.length == 0) return sweep_shape(shapes, shape, placed.pose(i), moving, path, limit, hit);
  return !placed.misses(i) && sweep_on_axes(
                                  shapes, shape, placed.ray(i), [&] { return placed.rotation(i); },
                                  placed.pose(i).position, moving, path, limit, hit);
}

}  // namespace ringfence::narrow_phase
