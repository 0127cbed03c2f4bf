#include "reference/core_distance.hpp"

#include <algorithm>
#include <array>
#include <cstddef>
#include <limits>
#include <vector>

namespace ringfence::reference {
namespace {

struct SimplexPoint {
  Vector difference;  // on_a - on_b
  Vector on_a, on_b;
};

/// Up to four points of the Minkowski difference, and the weights of the point of their hull that is nearest to the
/// origin.
struct Simplex {
  std::array<SimplexPoint, 4> points;
  std::array<double, 4> weights{};
  std::size_t size = 0;
  bool holds_origin = false;

  Vector nearest() const {
    Vector out;
    for (std::size_t i = 0; i < size; ++i) out += points[i].difference * weights[i];
    return out;
  }
};

SimplexPoint support(const CorePair& pair, const Vector& direction) {
  SimplexPoint out;
  out.on_a = pair.a.support(direction);
  out.on_b = pair.b_in_a * pair.b.support(pair.b_in_a.rotation.inverse(-direction));
  out.difference = out.on_a - out.on_b;
  return out;
}

/// Computes the weights of the origin's projection on the plane or line of the chosen points. Returns false unless the
/// projection lies inside them.
bool project(const Simplex& s, const std::array<std::size_t, 4>& chosen, std::size_t count,
             std::array<double, 4>& weights) {
  const auto point = [&](std::size_t i) -> const Vector& { return s.points[chosen[i]].difference; };
  weights = {1, 0, 0, 0};
  if (count == 1) return true;
  if (count == 2) {
    const Vector edge = point(1) - point(0);
    const double squared = dot(edge, edge);
    if (!(squared > 0)) return false;
    weights[1] = -dot(point(0), edge) / squared;
    weights[0] = 1 - weights[1];
  } else if (count == 3) {
    const Vector n = cross(point(1) - point(0), point(2) - point(0));
    const double squared = dot(n, n);
    if (!(squared > 0)) return false;
    weights[0] = dot(cross(point(1), point(2)), n) / squared;
    weights[1] = dot(cross(point(2), point(0)), n) / squared;
    weights[2] = 1 - weights[0] - weights[1];
  } else {
    const Vector p = point(1) - point(0), q = point(2) - point(0), r = point(3) - point(0);
    const double volume = dot(p, cross(q, r));
    if (volume == 0) return false;
    weights[1] = -dot(point(0), cross(q, r)) / volume;
    weights[2] = -dot(point(0), cross(r, p)) / volume;
    weights[3] = -dot(point(0), cross(p, q)) / volume;
    weights[0] = 1 - weights[1] - weights[2] - weights[3];
  }
  return std::all_of(weights.begin(), weights.begin() + static_cast<std::ptrdiff_t>(count),
                     [](double w) { return w > 0; });
}

/// Reduces the simplex to the face that holds the point nearest to the origin. Every subset is tried, so a degenerate
/// subset does no harm.
void reduce(Simplex& s) {
  Simplex best;
  double least = std::numeric_limits<double>::infinity();
  for (unsigned subset = 1; subset < 1u << s.size; ++subset) {
    std::array<std::size_t, 4> chosen{};
    std::size_t count = 0;
    for (std::size_t i = 0; i < s.size; ++i) {
      if (subset & 1u << i) chosen[count++] = i;
    }
    Simplex face;
    if (!project(s, chosen, count, face.weights)) continue;
    face.size = count;
    for (std::size_t i = 0; i < count; ++i) face.points[i] = s.points[chosen[i]];
    const Vector v = face.nearest();
    if (dot(v, v) < least) least = dot(v, v), best = face;
    best.holds_origin |= count == 4;
  }
  s = best;
}

CoreDistance result_of(const Simplex& s, double lower) {
  CoreDistance out;
  for (std::size_t i = 0; i < s.size; ++i) {
    out.on_a += s.points[i].on_a * s.weights[i];
    out.on_b += s.points[i].on_b * s.weights[i];
  }
  out.upper = length(s.nearest());
  out.lower = std::min(lower, out.upper);
  return out;
}

Vector nearest_in_triangle(const Vector& p, const Vector& a, const Vector& b, const Vector& c) {
  Simplex s;
  s.size = 3;
  s.points[0].difference = a - p, s.points[1].difference = b - p, s.points[2].difference = c - p;
  reduce(s);
  return s.nearest() + p;
}

struct CoreSegment {
  Vector start, end;
};

/// The nearest points of two segments: those of the two lines if they lie within the segments, else at an end of one.
void nearest_on_segments(const CoreSegment& p, const CoreSegment& q, Vector& on_p, Vector& on_q) {
  const Vector u = p.end - p.start, v = q.end - q.start, between = q.start - p.start;
  double least = std::numeric_limits<double>::infinity();
  const auto consider = [&](const Vector& x, const Vector& y) {
    const double squared = dot(x - y, x - y);
    if (squared < least) least = squared, on_p = x, on_q = y;
  };
  const auto onto = [](const CoreSegment& s, const Vector& x) {
    const Vector d = s.end - s.start;
    return s.start + d * std::clamp(dot(x - s.start, d) / dot(d, d), 0.0, 1.0);
  };
  for (const Vector& x : {p.start, p.end}) consider(x, onto(q, x));
  for (const Vector& y : {q.start, q.end}) consider(onto(p, y), y);
  const Vector n = cross(u, v);
  const double squared = dot(n, n);
  if (squared > 0) {
    const double s = dot(cross(between, v), n) / squared, t = dot(cross(between, u), n) / squared;
    if (s > 0 && s < 1 && t > 0 && t < 1) consider(p.start + u * s, q.start + v * t);
  }
}

}  // namespace

CoreDistance gjk_distance(const CorePair& pair, double tolerance) {
  Simplex simplex;
  simplex.points[0] = support(pair, length(pair.b_in_a.offset) > 0 ? pair.b_in_a.offset : Vector{1, 0, 0});
  simplex.weights[0] = 1;
  simplex.size = 1;
  double lower = 0;
  double last = std::numeric_limits<double>::infinity();
  for (int step = 0; step < 1000; ++step) {
    const Vector v = simplex.nearest();
    const double upper = length(v);
    if (simplex.holds_origin || upper <= tolerance) {
      CoreDistance out = result_of(simplex, 0);
      out.upper = out.lower = 0;
      out.converged = true;
      return out;
    }
    const SimplexPoint w = support(pair, -v);
    lower = std::max(lower, dot(v, w.difference) / upper);
    CoreDistance out = result_of(simplex, lower);
    out.converged = upper - lower <= tolerance + 1e-14 * upper;
    if (out.converged || !(upper < last)) return out;
    last = upper;
    simplex.weights[simplex.size] = 0;
    simplex.points[simplex.size++] = w;
    reduce(simplex);
  }
  CoreDistance out = result_of(simplex, lower);
  return out;
}

CoreDistance exhaustive_distance(const CorePair& pair) {
  std::vector<Vector> b;
  for (const Vector& v : pair.b.vertices) b.push_back(pair.b_in_a * v);
  const auto& a = pair.a.vertices;

  CoreDistance out;
  out.upper = std::numeric_limits<double>::infinity();
  const auto consider = [&](const Vector& on_a, const Vector& on_b) {
    const double d = length(on_a - on_b);
    if (d < out.upper) out.upper = d, out.on_a = on_a, out.on_b = on_b;
  };
  for (const Vector& p : a) {
    for (const Vector& q : b) consider(p, q);
    for (const auto& t : pair.b.triangles) consider(p, nearest_in_triangle(p, b[t[0]], b[t[1]], b[t[2]]));
  }
  for (const Vector& q : b) {
    for (const auto& t : pair.a.triangles) consider(nearest_in_triangle(q, a[t[0]], a[t[1]], a[t[2]]), q);
  }
  const auto consider_segments = [&](const CoreSegment& p, const CoreSegment& q) {
    Vector on_p, on_q;
    nearest_on_segments(p, q, on_p, on_q);
    consider(on_p, on_q);
  };
  for (const auto& p : pair.a.segments) {
    for (const auto& q : pair.b.segments) consider_segments({a[p[0]], a[p[1]]}, {b[q[0]], b[q[1]]});
    for (const Vector& q : b) consider_segments({a[p[0]], a[p[1]]}, {q, q});
  }
  for (const auto& q : pair.b.segments) {
    for (const Vector& p : a) consider_segments({p, p}, {b[q[0]], b[q[1]]});
  }
  out.lower = out.upper;
  out.converged = true;
  return out;
}

}  // namespace ringfence::reference
