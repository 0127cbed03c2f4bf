#include "narrow_phase/query/sweep/mesh_sweep.hpp"

#include <algorithm>
#include <array>
#include <cstddef>

#include "geometry/vector.hpp"
#include "narrow_phase/query/core_distance.hpp"
#include "narrow_phase/query/mesh_boxes.hpp"
#include "narrow_phase/query/nearest/convex_nearest.hpp"
#include "narrow_phase/query/ray/line_box.hpp"

namespace ringfence::narrow_phase {
namespace {

using Corners = std::array<Vec3d, 3>;

Corners moved(const Corners& corners, const Vec3d& by) noexcept {
  return {corners[0] + by, corners[1] + by, corners[2] + by};
}

SweepContact sweep_ball_at_triangle(const Corners& corners, double radius, const LocalRay& path, double begin,
                                    double end, double tolerance) {
  const auto gap = [&](double place) {
    const Vec3d centre = path.at(place);
    return gap_of_ball(nearest_in_triangle(centre, corners[0], corners[1], corners[2]), centre, radius);
  };
  return advance(gap, path.direction, begin, end, tolerance);
}

/// Relative to where the shape is at the begin: rounding errors follow the distance of the corners from the origin.
SweepContact sweep_at_triangle(const Corners& corners, const MovingCore& moving, const LocalRay& path, double begin,
                               double end, double tolerance) {
  const Vec3d origin = path.at(begin);
  const ConvexCore triangle = ConvexCore::triangle(moved(corners, -origin).data());
  if (!moving.is_exact()) tolerance = sweep_tolerance(triangle.reach(), moving.size(), false);
  const auto gap = [&](double place) {
    return gap_between(triangle, moving.at(path.at(place) - origin), end - place + 4 * tolerance);
  };
  SweepContact out = advance(gap, path.direction, begin, end, tolerance);
  out.point = out.point + origin;
  return out;
}

bool touches_triangle(const Corners& corners, const MovingCore& shape, const Vec3d& position) {
  if (shape.is_sphere()) {
    const Vec3d nearest = nearest_in_triangle(position, corners[0], corners[1], corners[2]);
    return gap_of_ball(nearest, position, shape.radius()).touch;
  }
  const ConvexCore triangle = ConvexCore::triangle(moved(corners, -position).data());
  return core_distance(triangle, shape.at({}), 0).kind == CoreDistance::Kind::touch;
}

}  // namespace

SweepContact sweep_at_mesh(const geometry::Mesh& mesh, const MovingCore& moving, const LocalRay& path, double most,
                           std::uint32_t& triangle) {
  const double sizes = double{mesh.bounding_radius()} + moving.size();
  const double tolerance = sweep_tolerance(double{mesh.bounding_radius()}, moving.size(), true);
  const CornerBox box = moving.box();
  const Vec3d middle = (box.lower + box.upper) * 0.5, half = (box.upper - box.lower) * 0.5;
  const double rounding = 4 * path.slack + 0x1p-20 * sizes;
  const LineInBox line(path.foot + middle, path.direction, half + Vec3d{rounding, rounding, rounding});
  const auto bound = [&](const CornerBox& of_node) {
    const double enter = line.enter(of_node, path.begin);
    return enter < infinity ? std::max(enter, path.begin) : infinity;
  };
  SweepContact best;
  most = std::min(most, path.end + path.slack);
  visit_triangles(
      mesh.tree(), most, bound,
      [&](const Corners& corners, const geometry::TriangleGroup& leaf, std::size_t lane, double least) {
        const SweepContact found = moving.is_sphere()
                                       ? sweep_ball_at_triangle(corners, moving.radius(), path, least, most, tolerance)
                                       : sweep_at_triangle(corners, moving, path, least, most, tolerance);
        const std::uint32_t number = leaf.index[lane];
        const bool is_tied = best.kind != SweepContact::Kind::none && found.place == most;
        if (found.kind == SweepContact::Kind::none || found.place > most || (is_tied && number > triangle)) {
          return most;
        }
        best = found;
        triangle = number;
        return most = found.place;
      });
  return best;
}

bool overlaps_mesh(const geometry::Mesh& mesh, const MovingCore& shape, const Vec3d& position,
                   std::uint32_t& triangle) {
  CornerBox box = shape.box();
  box = {box.lower + position, box.upper + position};
  const double margin = 0x1p-20 * (double{mesh.bounding_radius()} + shape.size());
  const auto bound = [&](const CornerBox& of_node) {
    const Vec3d p = box.lower - of_node.upper, q = of_node.lower - box.upper;
    return std::max({p.x, p.y, p.z, q.x, q.y, q.z}) <= margin ? 0.0 : infinity;
  };
  bool found = false;
  visit_triangles(mesh.tree(), 0, bound,
                  [&](const Corners& corners, const geometry::TriangleGroup& leaf, std::size_t lane, double) {
                    const std::uint32_t number = leaf.index[lane];
                    if (found && number > triangle) return 0.0;
                    if (!touches_triangle(corners, shape, position)) return 0.0;
                    found = true;
                    triangle = number;
                    return 0.0;
                  });
  return found;
}

}  // namespace ringfence::narrow_phase
