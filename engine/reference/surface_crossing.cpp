#include "reference/surface_crossing.hpp"

#include <algorithm>
#include <cstddef>

#include "reference/exact.hpp"

namespace ringfence::reference {
namespace {

bool apart(const Extents& p, const Extents& q) {
  return p.lower.x > q.upper.x || q.lower.x > p.upper.x || p.lower.y > q.upper.y || q.lower.y > p.upper.y ||
         p.lower.z > q.upper.z || q.lower.z > p.upper.z;
}

/// Whether the segment and the triangle have a point in common and do not lie in one plane.
bool cross_exactly(const Surface::Triangle& t, const Vector& start, const Vector& end) {
  const Vector& a = t.corners[0];
  const Vector& b = t.corners[1];
  const Vector& c = t.corners[2];
  const int side_of_start = orientation(a, b, c, start), side_of_end = orientation(a, b, c, end);
  if (side_of_start == side_of_end) return false;  // both 0: in the plane
  const int ab = orientation(start, end, a, b), bc = orientation(start, end, b, c), ca = orientation(start, end, c, a);
  return (ab >= 0 && bc >= 0 && ca >= 0) || (ab <= 0 && bc <= 0 && ca <= 0);
}

double fraction_at(const Surface::Triangle& t, const Vector& start, const Vector& end) {
  const Vector normal = triangle_normal(t.corners[0], t.corners[1], t.corners[2]);
  const double from_start = dot(normal, start - t.corners[0]), from_end = dot(normal, end - t.corners[0]);
  return from_start == from_end ? 0 : std::clamp(from_start / (from_start - from_end), 0.0, 1.0);
}

}  // namespace

std::optional<double> first_crossing(const Surface& surface, const Vector& start, const Vector& end) {
  Extents box{start, start};
  include(box, end);
  std::optional<double> first;
  for (std::size_t run = 0; run < surface.runs.size(); ++run) {
    if (apart(surface.runs[run], box)) continue;
    const std::size_t stop = std::min((run + 1) * Surface::run_length, surface.triangles.size());
    for (std::size_t i = run * Surface::run_length; i < stop; ++i) {
      const Surface::Triangle& t = surface.triangles[i];
      if (!cross_exactly(t, start, end)) continue;
      const double fraction = fraction_at(t, start, end);
      if (!first || fraction < *first) first = fraction;
    }
  }
  return first;
}

}  // namespace ringfence::reference
