#include "narrow_phase/query/hull_point_distance.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <optional>
#include <span>

#include "narrow_phase/query/hull_features.hpp"
#include "narrow_phase/query/nearest/convex_nearest.hpp"

namespace ringfence::narrow_phase {
namespace {

/// The point of the face below `point`; none if that is beside the face.
std::optional<Vec3d> below(const geometry::Hull& hull, std::uint32_t face, const Vec3d& point) noexcept {
  const std::span<const std::uint16_t> corners = hull.face(face);
  const Vec3d first = to_double(hull.vertex(corners[0])), from_first = point - first;
  Vec3d last = to_double(hull.vertex(corners[1])) - first;
  for (std::size_t i = 2; i < corners.size(); ++i) {
    const Vec3d next = to_double(hull.vertex(corners[i])) - first, normal = cross(last, next);
    const double area = dot(normal, normal);
    const double at_last = dot(cross(from_first, next), normal), at_next = dot(cross(last, from_first), normal);
    if (at_last >= 0 && at_next >= 0 && at_last + at_next <= area && area > 0) {
      return first + last * (at_last / area) + next * (at_next / area);
    }
    last = next;
  }
  return std::nullopt;
}

Vec3d nearest_on_edge(const geometry::Hull& hull, std::uint32_t edge, const Vec3d& point) noexcept {
  const geometry::EdgeEnds ends = hull.edge_ends(edge);
  return nearest_on_segment(point, to_double(hull.vertex(ends.from)), to_double(hull.vertex(ends.to)));
}

/// Whether `nearest` is proven to be the nearest point of the hull.
bool is_proven(const geometry::Hull& hull, double tolerance, const Vec3d& point, const Vec3d& nearest,
               CoreDistance& out) noexcept {
  const Vec3d between = point - nearest;
  const double distance = length(between);
  if (!(distance > 0)) return false;
  out.upper = distance;
  out.normal = between * (1 / distance);
  out.along = dot(out.normal, point - to_double(hull.vertex(farthest_vertex(hull, out.normal))));
  out.lower = std::min(out.along, distance);
  out.on_a = nearest;
  return distance - out.along <= tolerance + 0x1p-49 * distance;
}

}  // namespace

bool hull_point_distance(const ConvexCore& core, const Vec3d& point, double radius, double limit,
                         CoreDistance& out) noexcept {
  const geometry::Hull& hull = *core.hull();
  const Vec3d local = core.to_own_axes(point);
  const Vec3f rounded = to_float(local);
  const HighestFace highest = highest_face(hull, rounded);
  // Far more than the rounding of the floats and of the planes.
  const double rounding = 0x1p-18 * (core.reach() + length(local));
  if (!(double{highest.height} > rounding)) return false;
  if (double{highest.height} - rounding > limit + radius) {
    out.kind = CoreDistance::Kind::beyond;
    out.lower = double{highest.height} - rounding;
    return true;
  }
  const double tolerance = distance_tolerance(core.reach(), true);
  const std::optional<Vec3d> on_face = below(hull, highest.face, local);
  if (!(on_face && is_proven(hull, tolerance, local, *on_face, out)) &&
      !is_proven(hull, tolerance, local, nearest_on_edge(hull, nearest_edge(hull, rounded), local), out)) {
    return false;
  }
  out.kind = out.upper <= radius          ? CoreDistance::Kind::touch
             : out.lower > limit + radius ? CoreDistance::Kind::beyond
                                          : CoreDistance::Kind::apart;
  out.on_a = core.to_frame(out.on_a);
  out.on_b = point;
  out.normal = core.turn_to_frame(out.normal);
  return true;
}

}  // namespace ringfence::narrow_phase
