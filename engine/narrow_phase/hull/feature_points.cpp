#include "narrow_phase/hull/feature_points.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <limits>

#include "geometry/vector.hpp"

namespace ringfence::narrow_phase {
namespace {

struct Point2 {
  double x, y;
};
Point2 operator-(Point2 p, Point2 q) { return {p.x - q.x, p.y - q.y}; }
double cross_2d(Point2 p, Point2 q) { return p.x * q.y - p.y * q.x; }
double dot(Point2 p, Point2 q) { return p.x * q.x + p.y * q.y; }
Point2 between(Point2 p, Point2 q, double part) { return {p.x + (q.x - p.x) * part, p.y + (q.y - p.y) * part}; }

/// A convex polygon, anticlockwise; one or two points where it is degenerate. Clipping adds at most one corner per
/// side.
struct Polygon {
  std::array<Point2, 4 * max_feature_points> corner;
  std::size_t size = 0;

  /// Corners beyond the capacity are dropped. Only rounding can produce that many for two convex polygons.
  void append(Point2 p) {
    if (size < corner.size()) corner[size++] = p;
  }
  Point2 next(std::size_t i) const { return corner[i + 1 < size ? i + 1 : 0]; }
};

/// A basis of the plane perpendicular to the normal.
struct Frame {
  Vec3d u, v;

  explicit Frame(Vec3d n) {
    const Vec3d across = std::abs(n.x) < 0.6 ? Vec3d{0, n.z, -n.y} : Vec3d{-n.z, 0, n.x};
    u = across * (1 / length(across));
    v = cross(n, u);
  }
  Point2 project(Vec3d p) const { return {ringfence::dot(p, u), ringfence::dot(p, v)}; }
};

/// Convex hull by Andrew's monotone chain.
void make_hull(std::span<const Vec3d> points, const Frame& frame, Polygon& out) {
  std::array<Point2, max_feature_points> sorted;
  std::size_t count = 0;
  for (const Vec3d& p : points) sorted[count++] = frame.project(p);
  std::sort(sorted.begin(), sorted.begin() + static_cast<std::ptrdiff_t>(count),
            [](Point2 p, Point2 q) { return p.x != q.x ? p.x < q.x : p.y < q.y; });
  out.size = 0;
  const auto chain = [&](Point2 p, std::size_t start) {
    while (out.size >= start + 2 &&
           cross_2d(out.corner[out.size - 1] - out.corner[out.size - 2], p - out.corner[out.size - 2]) <= 0) {
      --out.size;
    }
    out.append(p);
  };
  for (std::size_t i = 0; i < count; ++i) chain(sorted[i], 0);
  const std::size_t lower = out.size - 1;
  for (std::size_t i = count - 1; i-- > 0;) chain(sorted[i], lower);
  if (out.size > 1) --out.size;  // the first point again
}

/// How far each corner of a polygon is to the left of a line, times the length of the line's direction; the first
/// corner again at the end.
using Distances = std::array<double, 4 * max_feature_points + 1>;

/// Memory for clip(). The two polygons take turns, so that none is copied: each has 16 KiB, most of it unused.
struct Spares {
  Polygon polygons[2];
  Distances left;
};

/// Computes `left` for the line through `from` along `side`. Returns the least.
double compute_left(const Polygon& polygon, Point2 from, Point2 side, Distances& left) {
  double least = std::numeric_limits<double>::infinity();
  for (std::size_t i = 0; i < polygon.size; ++i) {
    left[i] = cross_2d(side, polygon.corner[i] - from);
    least = std::min(least, left[i]);
  }
  left[polygon.size] = left[0];
  return least;
}

/// The part of a polygon to the left of a line.
void cut(const Polygon& polygon, const Distances& left, Polygon& out) {
  out.size = 0;
  for (std::size_t i = 0; i < polygon.size; ++i) {
    const Point2 p = polygon.corner[i];
    const double p_left = left[i], q_left = left[i + 1];
    if (p_left >= 0) out.append(p);
    if ((p_left > 0 && q_left < 0) || (p_left < 0 && q_left > 0)) {
      out.append(between(p, polygon.next(i), p_left / (p_left - q_left)));
    }
  }
}

/// `subject` clipped by `by`, whose area must not be zero (Sutherland and Hodgman 1974).
const Polygon& clip(const Polygon& subject, const Polygon& by, Spares& spares) {
  const Polygon* clipped = &subject;
  for (std::size_t s = 0; s < by.size && clipped->size > 0; ++s) {
    const Point2 from = by.corner[s];
    if (compute_left(*clipped, from, by.next(s) - from, spares.left) >= 0) continue;
    Polygon& next = clipped == &spares.polygons[0] ? spares.polygons[1] : spares.polygons[0];
    cut(*clipped, spares.left, next);
    clipped = &next;
  }
  return *clipped;
}

Point2 middle(const Polygon& polygon) {
  Point2 sum{0, 0};
  for (std::size_t i = 0; i < polygon.size; ++i) sum = {sum.x + polygon.corner[i].x, sum.y + polygon.corner[i].y};
  const auto count = static_cast<double>(polygon.size);
  return {sum.x / count, sum.y / count};
}

/// The middle of a clipped segment; clipping may have duplicated its ends.
Point2 middle_along(const Polygon& points, Point2 along) {
  const auto before = [&](Point2 p, Point2 q) { return dot(p, along) < dot(q, along); };
  const auto [low, high] = std::minmax_element(
      points.corner.begin(), points.corner.begin() + static_cast<std::ptrdiff_t>(points.size), before);
  return between(*low, *high, 0.5);
}

struct NearestOfSides {
  double squared = std::numeric_limits<double>::infinity();
  Point2 middle{0, 0};

  void point_to_sides(Point2 p, const Polygon& sides) {
    for (std::size_t s = 0; s < sides.size; ++s) {
      const Point2 from = sides.corner[s], side = sides.next(s) - from;
      const double whole = dot(side, side);
      const double part = whole > 0 ? std::clamp(dot(p - from, side) / whole, 0.0, 1.0) : 0.0;
      const Point2 q = between(from, sides.next(s), part), gap = p - q;
      if (dot(gap, gap) < squared) squared = dot(gap, gap), middle = between(p, q, 0.5);
    }
  }
  void corners_to_sides(const Polygon& corners, const Polygon& sides) {
    for (std::size_t i = 0; i < corners.size; ++i) point_to_sides(corners.corner[i], sides);
  }
};

/// Whether a point is certainly inside of a triangle, both projected along a normal.
bool is_in_triangle(Vec3d p, Vec3d q, Vec3d r, Vec3d point, Vec3d normal) {
  const Vec3d from_p = point - p, from_q = point - q, from_r = point - r;
  const double left_of_pq = ringfence::dot(normal, cross(from_p, from_q)),
               left_of_qr = ringfence::dot(normal, cross(from_q, from_r)),
               left_of_rp = ringfence::dot(normal, cross(from_r, from_p));
  return (left_of_pq > 0 && left_of_qr > 0 && left_of_rp > 0) || (left_of_pq < 0 && left_of_qr < 0 && left_of_rp < 0);
}

bool is_inside(const Polygon& polygon, Point2 p) {
  bool inside = polygon.size > 2;
  for (std::size_t s = 0; inside && s < polygon.size; ++s) {
    inside = cross_2d(polygon.next(s) - polygon.corner[s], p - polygon.corner[s]) >= 0;
  }
  return inside;
}

/// For two segments: their crossing, or the middle of their common part if they are collinear.
Point2 intersect_segments(const Polygon& p, const Polygon& q) {
  const Point2 along = p.corner[1] - p.corner[0], other = q.corner[1] - q.corner[0];
  const double sine = cross_2d(along, other), scale = std::sqrt(dot(along, along) * dot(other, other));
  if (std::abs(sine) > 1e-6 * scale) {
    const double part = cross_2d(q.corner[0] - p.corner[0], other) / sine;
    return between(p.corner[0], p.corner[1], std::clamp(part, 0.0, 1.0));
  }
  const double whole = dot(along, along);
  const double s = dot(q.corner[0] - p.corner[0], along) / whole, t = dot(q.corner[1] - p.corner[0], along) / whole;
  const double low = std::clamp(std::min(s, t), 0.0, 1.0), high = std::clamp(std::max(s, t), 0.0, 1.0);
  return between(p.corner[0], p.corner[1], 0.5 * (low + high));
}

Point2 intersect_features(const Polygon& p, const Polygon& q, Spares& spares) {
  if (p.size == 1) return p.corner[0];
  if (q.size == 1) return q.corner[0];
  if (p.size == 2 && q.size == 2) return intersect_segments(p, q);
  const Polygon& subject = q.size > 2 ? p : q;
  const Polygon& by = q.size > 2 ? q : p;
  const Polygon& common = clip(subject, by, spares);
  if (common.size == 0) {
    NearestOfSides nearest;
    nearest.corners_to_sides(p, q);
    nearest.corners_to_sides(q, p);
    return nearest.middle;
  }
  return subject.size == 2 ? middle_along(common, subject.next(0) - subject.corner[0]) : middle(common);
}

}  // namespace

Vec3d common_point(std::span<const Vec3d> first, std::span<const Vec3d> second, Vec3d normal) noexcept {
  if (first.size() == 1) return first[0];
  if (second.size() == 1) return second[0];
  if (first.size() == 2 && second.size() == 2) {
    // Two crossing edges, the most frequent case for hulls, need no basis.
    const Vec3d along = first[1] - first[0], other = second[1] - second[0];
    const double sine = ringfence::dot(normal, cross(along, other));
    if (sine * sine > 1e-12 * ringfence::dot(along, along) * ringfence::dot(other, other)) {
      // Clamped to both edges: where only their ends are close, the lines may cross far away.
      const auto clamp_to_edge = [normal](Vec3d from, Vec3d edge, Vec3d to) {
        const Vec3d gap = to - from, level = edge - normal * ringfence::dot(normal, edge);
        return from + edge * std::clamp(ringfence::dot(gap, level) / ringfence::dot(level, level), 0.0, 1.0);
      };
      const double part = ringfence::dot(normal, cross(second[0] - first[0], other)) / sine;
      const Vec3d near = clamp_to_edge(second[0], other, first[0] + along * std::clamp(part, 0.0, 1.0));
      return (clamp_to_edge(first[0], along, near) + near) * 0.5;
    }
  }
  const Frame frame(normal);
  Polygon p, q;
  Spares spares;
  make_hull(first, frame, p);
  make_hull(second, frame, q);
  const Point2 at = intersect_features(p, q, spares);
  return frame.u * at.x + frame.v * at.y;
}

double distance_from_feature(std::span<const Vec3d> feature, Vec3d point, Vec3d normal) noexcept {
  // The most frequent cases need no basis: a corner, an edge, and a point inside a triangle of the feature.
  if (feature.size() <= 2) {
    const auto level = [normal](Vec3d v) { return v - normal * ringfence::dot(normal, v); };
    const Vec3d gap = level(point - feature[0]), edge = level(feature.back() - feature[0]);
    const double whole = ringfence::dot(edge, edge);
    const double part = whole > 0 ? std::clamp(ringfence::dot(gap, edge) / whole, 0.0, 1.0) : 0.0;
    return length(gap - edge * part);
  }
  for (std::size_t i = 2; i < feature.size(); ++i) {
    if (is_in_triangle(feature[i - 2], feature[i - 1], feature[i], point, normal)) return 0;
  }
  const Frame frame(normal);
  const Point2 p = frame.project(point);
  Polygon polygon;
  make_hull(feature, frame, polygon);
  if (is_inside(polygon, p)) return 0;
  NearestOfSides nearest;
  nearest.point_to_sides(p, polygon);
  return std::sqrt(nearest.squared);
}

}  // namespace ringfence::narrow_phase
