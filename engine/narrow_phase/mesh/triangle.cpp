#include "narrow_phase/mesh/triangle.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <iterator>
#include <limits>

#include "narrow_phase/hull/feature_points.hpp"

namespace ringfence::narrow_phase {
namespace {

constexpr int next(int i) noexcept { return i == 2 ? 0 : i + 1; }

/// If the squared sine between two directions is below this, they have no common perpendicular.
constexpr double parallel_sine_squared = 1e-20;

struct Interval {
  double low, high;
};

Interval extent(const Triangle& t, Vec3d axis) noexcept {
  const double p = dot(t.corner[0], axis), q = dot(t.corner[1], axis), r = dot(t.corner[2], axis);
  return {std::min({p, q, r}), std::max({p, q, r})};
}

/// The least penetration among the directions tried.
class Least {
 public:
  explicit Least(double at_least) noexcept : at_least_(at_least) {}

  /// Tries an axis of any length in both directions. Returns false as soon as the depth is less than required.
  bool take(Vec3d axis, double squared, Interval triangle, Interval other) noexcept {
    const double inverse = 1 / std::sqrt(squared);
    const double along = (triangle.high - other.low) * inverse, against = (other.high - triangle.low) * inverse;
    const double less = std::min(along, against);
    if (less < penetration_.depth) penetration_ = {less, axis * (along <= against ? inverse : -inverse)};
    return less >= at_least_;
  }

  const Penetration& penetration() const noexcept { return penetration_; }

 private:
  double at_least_;
  Penetration penetration_{std::numeric_limits<double>::infinity(), {}};
};

/// The point of the triangle nearest to `p`, by the Voronoi regions of its features (Ericson, "Real-Time Collision
/// Detection").
Vec3d nearest_point(const Triangle& t, Vec3d p) noexcept {
  const Vec3d a = t.corner[0], b = t.corner[1], c = t.corner[2];
  const Vec3d ab = b - a, ac = c - a, ap = p - a;
  const double d1 = dot(ab, ap), d2 = dot(ac, ap);
  if (d1 <= 0 && d2 <= 0) return a;
  const Vec3d bp = p - b;
  const double d3 = dot(ab, bp), d4 = dot(ac, bp);
  if (d3 >= 0 && d4 <= d3) return b;
  const double vc = d1 * d4 - d3 * d2;
  if (vc <= 0 && d1 >= 0 && d3 <= 0) return a + ab * (d1 / (d1 - d3));
  const Vec3d cp = p - c;
  const double d5 = dot(ab, cp), d6 = dot(ac, cp);
  if (d6 >= 0 && d5 <= d6) return c;
  const double vb = d5 * d2 - d1 * d6;
  if (vb <= 0 && d2 >= 0 && d6 <= 0) return a + ac * (d2 / (d2 - d6));
  const double va = d3 * d6 - d5 * d4;
  if (va <= 0 && d4 - d3 >= 0 && d5 - d6 >= 0) return b + (c - b) * ((d4 - d3) / ((d4 - d3) + (d5 - d6)));
  // Inside: along the normal, so that the remainder is exactly perpendicular to the plane.
  const Vec3d normal = cross(ab, ac);
  return p - normal * (dot(normal, ap) / dot(normal, normal));
}

struct NearestPoints {
  Vec3d on_triangle, on_other;
  double squared = std::numeric_limits<double>::infinity();

  void take(Vec3d p, Vec3d q) noexcept {
    const Vec3d gap = q - p;
    const double next = dot(gap, gap);
    if (next < squared) squared = next, on_triangle = p, on_other = q;
  }
};

/// The nearest points of two segments: those of the lines if they lie within both, else with one clamped and the other
/// recomputed.
void take_segments(Vec3d p, Vec3d u, Vec3d q, Vec3d v, NearestPoints& nearest) noexcept {
  const Vec3d r = p - q;
  const double uu = dot(u, u), vv = dot(v, v), uv = dot(u, v), ur = dot(u, r), vr = dot(v, r);
  const double across = uu * vv - uv * uv;
  const double s = across > 0 ? std::clamp((uv * vr - ur * vv) / across, 0.0, 1.0) : 0.0;
  const double t = std::clamp((uv * s + vr) / vv, 0.0, 1.0);
  const double back = std::clamp((uv * t - ur) / uu, 0.0, 1.0);
  nearest.take(p + u * back, q + v * t);
}

/// The penetration of everything within `radius` of the nearest point, if the direction of the gap is precise enough.
/// The shorter the gap is compared with the longest edge of the two cores, the less precise it is; but a gap that is
/// significant compared with the radius is always used.
bool penetration_of_nearest(const NearestPoints& nearest, double radius, double longest_squared,
                            Penetration& out) noexcept {
  const double distance = std::sqrt(nearest.squared);
  if (!(distance > std::min(1e-5 * radius, 1e-9 * radius + 1e-10 * longest_squared / radius))) return false;
  out = {radius - distance, (nearest.on_other - nearest.on_triangle) * (1 / distance)};
  return true;
}

double longest_edge_squared(const Triangle& t) noexcept {
  const Vec3d p = t.corner[1] - t.corner[0], q = t.corner[2] - t.corner[1], r = t.corner[0] - t.corner[2];
  return std::max({dot(p, p), dot(q, q), dot(r, r)});
}

Penetration none_if_less(const Penetration& penetration, double at_least) noexcept {
  return penetration.depth >= at_least ? penetration : Penetration{};
}

}  // namespace

Triangle triangle_of(const geometry::TriangleGroup& leaf, std::size_t lane) noexcept {
  Triangle out;
  for (int c = 0; c < 3; ++c) {
    out.corner[c] = {double{leaf.corner[c][0][lane]}, double{leaf.corner[c][1][lane]}, double{leaf.corner[c][2][lane]}};
  }
  return out;
}

Penetration ball_penetration(const Triangle& t, Vec3d centre, double radius, double at_least) noexcept {
  NearestPoints nearest;
  nearest.take(nearest_point(t, centre), centre);
  Penetration penetration;
  if (!penetration_of_nearest(nearest, radius, longest_edge_squared(t), penetration)) {
    const Vec3d across = cross(t.corner[1] - t.corner[0], t.corner[2] - t.corner[0]);
    const Vec3d normal = across * (1 / length(across));
    const double height = dot(normal, centre - t.corner[0]);
    penetration = {radius - std::abs(height), height < 0 ? -normal : normal};
  }
  return none_if_less(penetration, at_least);
}

Penetration capsule_penetration(const Triangle& t, const Vec3d ends[2], double radius, double at_least) noexcept {
  const Vec3d along = ends[1] - ends[0];
  const double length_squared = dot(along, along);
  if (!(length_squared > 1e-18 * radius * radius)) return ball_penetration(t, ends[0], radius, at_least);

  // The core overlaps the triangle by the least penetration along these axes, if it does.
  Least core(-std::numeric_limits<double>::infinity());
  const auto try_axis = [&](Vec3d axis, double limit) {
    const double squared = dot(axis, axis);
    if (!(squared > limit)) return;
    const double p = dot(ends[0], axis), q = dot(ends[1], axis);
    core.take(axis, squared, extent(t, axis), {std::min(p, q), std::max(p, q)});
  };
  const Vec3d normal = cross(t.corner[1] - t.corner[0], t.corner[2] - t.corner[0]);
  try_axis(normal, 0);
  NearestPoints nearest;
  for (int i = 0; i < 3; ++i) {
    const Vec3d edge = t.corner[next(i)] - t.corner[i];
    try_axis(cross(edge, along), parallel_sine_squared * dot(edge, edge) * length_squared);
    take_segments(t.corner[i], edge, ends[0], along, nearest);
  }
  nearest.take(nearest_point(t, ends[0]), ends[0]);
  nearest.take(nearest_point(t, ends[1]), ends[1]);
  Penetration penetration;
  // A core in the plane of the triangle does not overlap along any axis, but may be far away: its distance decides.
  const bool pierces = core.penetration().depth > 1e-12 * (radius + std::sqrt(length_squared));
  if (pierces ||
      !penetration_of_nearest(nearest, radius, std::max(length_squared, longest_edge_squared(t)), penetration)) {
    penetration = {radius + std::max(core.penetration().depth, 0.0), core.penetration().normal};
  }
  return none_if_less(penetration, at_least);
}

Penetration box_penetration(const Triangle& t, Vec3d centre, const geometry::RotationD& rotation, const double half[3],
                            double at_least) noexcept {
  const Triangle about{{t.corner[0] - centre, t.corner[1] - centre, t.corner[2] - centre}};
  const auto axis_of = [&](int k) { return Vec3d{rotation.m[0][k], rotation.m[1][k], rotation.m[2][k]}; };
  const Vec3d axes[3] = {axis_of(0), axis_of(1), axis_of(2)};
  Least least(at_least);
  const auto try_axis = [&](Vec3d axis, double limit) {
    const double squared = dot(axis, axis);
    if (!(squared > limit)) return true;
    const double box_extent = (half[0] * std::abs(dot(axes[0], axis)) + half[1] * std::abs(dot(axes[1], axis))) +
                              half[2] * std::abs(dot(axes[2], axis));
    return least.take(axis, squared, extent(about, axis), {-box_extent, box_extent});
  };
  if (!try_axis(cross(t.corner[1] - t.corner[0], t.corner[2] - t.corner[0]), 0)) return {};
  for (const Vec3d& axis : axes) {
    if (!try_axis(axis, 0)) return {};
  }
  for (int i = 0; i < 3; ++i) {
    const Vec3d edge = t.corner[next(i)] - t.corner[i];
    for (const Vec3d& axis : axes) {
      if (!try_axis(cross(edge, axis), parallel_sine_squared * dot(edge, edge))) return {};
    }
  }
  return least.penetration();
}

Penetration triangle_penetration(const Triangle& p, const Triangle& q, double at_least) noexcept {
  // Relative to a corner, so that no precision is lost far from the origin.
  const Vec3d from = p.corner[0];
  const Triangle a{{{}, p.corner[1] - from, p.corner[2] - from}};
  const Triangle b{{q.corner[0] - from, q.corner[1] - from, q.corner[2] - from}};
  Least least(at_least);
  const auto try_axis = [&](Vec3d axis, double limit) {
    const double squared = dot(axis, axis);
    return !(squared > limit) || least.take(axis, squared, extent(a, axis), extent(b, axis));
  };
  const Vec3d normal_a = cross(a.corner[1], a.corner[2]);
  const Vec3d normal_b = cross(b.corner[1] - b.corner[0], b.corner[2] - b.corner[0]);
  if (!try_axis(normal_a, 0) || !try_axis(normal_b, 0)) return {};
  const Vec3d across = cross(normal_a, normal_b);
  // If the triangles are nearly coplanar, the separating axis lies in their plane.
  if (dot(across, across) < 1e-6 * dot(normal_a, normal_a) * dot(normal_b, normal_b)) {
    for (int i = 0; i < 3; ++i) {
      if (!try_axis(cross(normal_a, a.corner[next(i)] - a.corner[i]), 0)) return {};
      if (!try_axis(cross(normal_b, b.corner[next(i)] - b.corner[i]), 0)) return {};
    }
  }
  for (int i = 0; i < 3; ++i) {
    const Vec3d edge = a.corner[next(i)] - a.corner[i];
    for (int j = 0; j < 3; ++j) {
      const Vec3d other = b.corner[next(j)] - b.corner[j];
      if (!try_axis(cross(edge, other), parallel_sine_squared * dot(edge, edge) * dot(other, other))) return {};
    }
  }
  return least.penetration();
}

Vec3d contact_point_of(const Penetration& penetration, const Triangle& triangle, std::span<const Vec3d> points,
                       double radius, double slack) noexcept {
  const Vec3d n = penetration.normal;
  const double high = extent(triangle, n).high;
  double low = std::numeric_limits<double>::infinity();
  for (const Vec3d& p : points) low = std::min(low, dot(n, p));
  Vec3d best;
  double least = std::numeric_limits<double>::infinity();
  // Where two faces or edges are nearly parallel, the deepest corners may lie beside each other: then larger parts of
  // them, which are only slightly less deep, touch.
  constexpr double widths[] = {1, 32, 1024};
  for (std::size_t i = 0; i < std::size(widths) && least > slack; ++i) {
    const double part = widths[i] * slack;
    std::array<Vec3d, 3> of_triangle;
    std::size_t corners = 0;
    for (const Vec3d& p : triangle.corner) {
      if (dot(n, p) >= high - part) of_triangle[corners++] = p;
    }
    FeaturePoints of_other;
    for (const Vec3d& p : points) {
      if (dot(n, p) <= low + part) of_other.add(p);
    }
    const std::span<const Vec3d> first(of_triangle.data(), corners), second = of_other.get();
    const Vec3d common = common_point(first, second, n);
    // The direction of a round shape comes from the nearest points of the two, so its features are never beside.
    const double beside =
        radius > 0 ? 0 : std::max(distance_from_feature(first, common, n), distance_from_feature(second, common, n));
    if (beside < least) least = beside, best = common;
  }
  return best + n * (0.5 * (high + (low - radius)) - dot(n, best));
}

}  // namespace ringfence::narrow_phase
