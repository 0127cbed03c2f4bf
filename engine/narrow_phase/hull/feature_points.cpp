#include "narrow_phase/hull/feature_points.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <limits>

#include "geometry/vector.hpp"

namespace ringfence::narrow_phase {
namespace {

struct Flat {
  double x, y;
};
Flat operator-(Flat p, Flat q) { return {p.x - q.x, p.y - q.y}; }
double turn(Flat p, Flat q) { return p.x * q.y - p.y * q.x; }
double dot(Flat p, Flat q) { return p.x * q.x + p.y * q.y; }
Flat between(Flat p, Flat q, double part) { return {p.x + (q.x - p.x) * part, p.y + (q.y - p.y) * part}; }

/// A convex polygon, anticlockwise; one point or two where it is flat. Clipping adds a corner for each side at most.
struct Polygon {
  std::array<Flat, 4 * max_feature_points> corner;
  std::size_t size = 0;

  /// Past what rounding can make of two convex polygons, corners are left out.
  void penetration(Flat p) {
    if (size < corner.size()) corner[size++] = p;
  }
  Flat next(std::size_t i) const { return corner[i + 1 < size ? i + 1 : 0]; }
};

/// The plane across the normal.
struct Frame {
  Vec3d u, v;

  explicit Frame(Vec3d n) {
    const Vec3d across = std::abs(n.x) < 0.6 ? Vec3d{0, n.z, -n.y} : Vec3d{-n.z, 0, n.x};
    u = across * (1 / length(across));
    v = cross(n, u);
  }
  Flat project(Vec3d p) const { return {ringfence::dot(p, u), ringfence::dot(p, v)}; }
};

/// Andrew's monotone chain.
void make_hull(std::span<const Vec3d> points, const Frame& frame, Polygon& out) {
  std::array<Flat, max_feature_points> sorted;
  std::size_t count = 0;
  for (const Vec3d& p : points) sorted[count++] = frame.project(p);
  std::sort(sorted.begin(), sorted.begin() + static_cast<std::ptrdiff_t>(count),
            [](Flat p, Flat q) { return p.x != q.x ? p.x < q.x : p.y < q.y; });
  out.size = 0;
  const auto chain = [&](Flat p, std::size_t start) {
    while (out.size >= start + 2 &&
           turn(out.corner[out.size - 1] - out.corner[out.size - 2], p - out.corner[out.size - 2]) <= 0) {
      --out.size;
    }
    out.penetration(p);
  };
  for (std::size_t i = 0; i < count; ++i) chain(sorted[i], 0);
  const std::size_t lower = out.size - 1;
  for (std::size_t i = count - 1; i-- > 0;) chain(sorted[i], lower);
  if (out.size > 1) --out.size;  // the first point again
}

/// The part of `subject` on the left of every side of `by`, which has an area. (Sutherland and Hodgman 1974)
void clip(Polygon& subject, const Polygon& by, Polygon& spare) {
  for (std::size_t s = 0; s < by.size && subject.size > 0; ++s) {
    const Flat from = by.corner[s], side = by.next(s) - from;
    spare.size = 0;
    for (std::size_t i = 0; i < subject.size; ++i) {
      const Flat p = subject.corner[i], q = subject.next(i);
      const double p_left = turn(side, p - from), q_left = turn(side, q - from);
      if (p_left >= 0) spare.penetration(p);
      if ((p_left > 0 && q_left < 0) || (p_left < 0 && q_left > 0)) {
        spare.penetration(between(p, q, p_left / (p_left - q_left)));
      }
    }
    std::swap(subject, spare);
  }
}

Flat middle(const Polygon& polygon) {
  Flat sum{0, 0};
  for (std::size_t i = 0; i < polygon.size; ++i) sum = {sum.x + polygon.corner[i].x, sum.y + polygon.corner[i].y};
  const auto count = static_cast<double>(polygon.size);
  return {sum.x / count, sum.y / count};
}

/// Of what is left of a segment, whose ends clipping may have listed twice.
Flat middle_along(const Polygon& points, Flat along) {
  const auto before = [&](Flat p, Flat q) { return dot(p, along) < dot(q, along); };
  const auto [low, high] = std::minmax_element(
      points.corner.begin(), points.corner.begin() + static_cast<std::ptrdiff_t>(points.size), before);
  return between(*low, *high, 0.5);
}

struct Nearest {
  double squared = std::numeric_limits<double>::infinity();
  Flat middle{0, 0};

  void corners_to_sides(const Polygon& corners, const Polygon& sides) {
    for (std::size_t i = 0; i < corners.size; ++i) {
      for (std::size_t s = 0; s < sides.size; ++s) {
        const Flat p = corners.corner[i], from = sides.corner[s], side = sides.next(s) - from;
        const double whole = dot(side, side);
        const double part = whole > 0 ? std::clamp(dot(p - from, side) / whole, 0.0, 1.0) : 0.0;
        const Flat q = between(from, sides.next(s), part), gap = p - q;
        if (dot(gap, gap) < squared) squared = dot(gap, gap), middle = between(p, q, 0.5);
      }
    }
  }
};

/// Two segments: where they cross, or the middle of what they share if they lie on one line.
Flat meet(const Polygon& p, const Polygon& q) {
  const Flat along = p.corner[1] - p.corner[0], other = q.corner[1] - q.corner[0];
  const double sine = turn(along, other), scale = std::sqrt(dot(along, along) * dot(other, other));
  if (std::abs(sine) > 1e-6 * scale) {
    const double part = turn(q.corner[0] - p.corner[0], other) / sine;
    return between(p.corner[0], p.corner[1], std::clamp(part, 0.0, 1.0));
  }
  const double whole = dot(along, along);
  const double s = dot(q.corner[0] - p.corner[0], along) / whole, t = dot(q.corner[1] - p.corner[0], along) / whole;
  const double low = std::clamp(std::min(s, t), 0.0, 1.0), high = std::clamp(std::max(s, t), 0.0, 1.0);
  return between(p.corner[0], p.corner[1], 0.5 * (low + high));
}

Flat shared(Polygon& p, Polygon& q, Polygon& spare) {
  if (p.size == 1) return p.corner[0];
  if (q.size == 1) return q.corner[0];
  if (p.size == 2 && q.size == 2) return meet(p, q);
  Polygon& subject = q.size > 2 ? p : q;
  const Polygon& by = q.size > 2 ? q : p;
  Nearest nearest;
  nearest.corners_to_sides(p, q);
  nearest.corners_to_sides(q, p);
  const bool segment = subject.size == 2;
  const Flat along = subject.next(0) - subject.corner[0];
  clip(subject, by, spare);
  if (subject.size == 0) return nearest.middle;
  return segment ? middle_along(subject, along) : middle(subject);
}

}  // namespace

Vec3d common_point(std::span<const Vec3d> first, std::span<const Vec3d> second, Vec3d normal) noexcept {
  if (first.size() == 1) return first[0];
  if (second.size() == 1) return second[0];
  if (first.size() == 2 && second.size() == 2) {
    // Two edges that cross, which is what most hulls meet with, need no frame.
    const Vec3d along = first[1] - first[0], other = second[1] - second[0];
    const double sine = ringfence::dot(normal, cross(along, other));
    if (sine * sine > 1e-12 * ringfence::dot(along, along) * ringfence::dot(other, other)) {
      // Held within both: where only their ends come near each other, the lines may cross far from there.
      const auto held = [normal](Vec3d from, Vec3d way, Vec3d to) {
        const Vec3d gap = to - from, level = way - normal * ringfence::dot(normal, way);
        return from + way * std::clamp(ringfence::dot(gap, level) / ringfence::dot(level, level), 0.0, 1.0);
      };
      const double part = ringfence::dot(normal, cross(second[0] - first[0], other)) / sine;
      const Vec3d near = held(second[0], other, first[0] + along * std::clamp(part, 0.0, 1.0));
      return (held(first[0], along, near) + near) * 0.5;
    }
  }
  const Frame frame(normal);
  Polygon p, q, spare;
  make_hull(first, frame, p);
  make_hull(second, frame, q);
  const Flat at = shared(p, q, spare);
  return frame.u * at.x + frame.v * at.y;
}

}  // namespace ringfence::narrow_phase
