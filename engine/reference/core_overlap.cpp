#include "reference/core_overlap.hpp"

#include <algorithm>
#include <cstddef>
#include <limits>
#include <vector>

#include "reference/convex_surface.hpp"

namespace ringfence::reference {
namespace {

// Dot products of unit vectors are right to some 10^-16; whatever lies within this of a decision is tried.
constexpr double unsure = 1e-12;

void consider(const CorePair& pair, const Vector& n, CoreOverlap& best) {
  const double depth = pair.overlap(n);
  if (depth < best.depth) best.depth = depth, best.normal = n;
}

/// The directions of all faces of both.
CoreOverlap face_overlap(const CorePair& pair) {
  CoreOverlap best;
  best.depth = std::numeric_limits<double>::infinity();
  const auto& rotation = pair.b_in_a.rotation;
  const Vector& offset = pair.b_in_a.offset;
  for (std::size_t i = 0; i < pair.a.normals.size(); ++i) {
    const Vector& n = pair.a.normals[i];
    if (dot(n, n) < 0.5) continue;  // an area that rounds to zero has no normal
    const double depth = pair.a.offsets[i] + pair.b.extent(rotation.inverse(-n)) - dot(n, offset);
    if (depth < best.depth) best.depth = depth, best.normal = n;
  }
  for (std::size_t i = 0; i < pair.b.normals.size(); ++i) {
    const Vector n = -(rotation * pair.b.normals[i]);
    if (dot(n, n) < 0.5) continue;
    const double depth = pair.a.extent(n) + pair.b.offsets[i] - dot(n, offset);
    if (depth < best.depth) best.depth = depth, best.normal = n;
  }
  return best;
}

/// The unit vector across two edges, or zero if they are parallel within rounding: then the directions of the faces
/// beside them serve, since the Minkowski difference has no face of any width between.
Vector across(const Vector& p, const Vector& q) {
  const Vector n = cross(p, q);
  const double sine = length(n);
  return sine > 1e-14 ? n * (1 / sine) : Vector{};
}

/// Tries both senses of the direction across two edges, if it can lie on both arcs and can be the least.
void consider_edges(const CorePair& pair, const Core::Arc& p, const Vector& q_direction, const Vector& q_point,
                    const Vector& q_middle, CoreOverlap& best) {
  Vector n = across(p.direction, q_direction);
  if (dot(n, n) < 0.5) return;
  const Vector p_middle = pair.a.normals[p.faces[0]] + pair.a.normals[p.faces[1]];
  for (int sense = 0; sense < 2; ++sense, n = -n) {
    if (dot(n, p_middle) < -unsure || dot(n, q_middle) < -unsure) continue;
    // The two edges alone already overlap so far along n; the whole shapes at least as far.
    if (dot(n, p.point - q_point) < best.depth) consider(pair, n, best);
  }
}

/// Vectors by component, for loops over many of them.
struct Columns {
  std::vector<double> x, y, z;
  explicit Columns(const std::vector<Vector>& vectors) {
    for (const Vector& v : vectors) x.push_back(v.x), y.push_back(v.y), z.push_back(v.z);
  }
};

/// All dot products, row by row, into `out`, which only grows: zeroing it took a fifth of the time.
void dots(const std::vector<Vector>& rows, const Columns& columns, std::vector<double>& out) {
  const std::size_t count = columns.x.size();
  const double *const x = columns.x.data(), *const y = columns.y.data(), *const z = columns.z.data();
  out.resize(std::max(out.size(), rows.size() * count));
  for (std::size_t i = 0; i < rows.size(); ++i) {
    const Vector r = rows[i];
    double* const row = out.data() + i * count;
    for (std::size_t j = 0; j < count; ++j) row[j] = r.x * x[j] + r.y * y[j] + r.z * z[j];
  }
}

/// Whether two points are surely on the same side of a plane, given their distances from it, at most 1.
bool same_side(double p, double q) { return p * q > unsure; }

/// The directions from the middle of a cube to its corners, edges and faces.
std::vector<Vector> directions_around() {
  std::vector<Vector> out;
  for (int i = 0; i < 27; ++i) {
    if (i != 13) out.push_back(normalised(Vector(i % 3 - 1, i / 3 % 3 - 1, i / 9 - 1)));
  }
  return out;
}

/// The directions across the widest line and the widest triangle of some points.
std::vector<Vector> directions_across(const std::vector<Vector>& points) {
  const auto farthest = [&](auto measure) {
    return *std::max_element(points.begin(), points.end(),
                             [&](const Vector& p, const Vector& q) { return measure(p) < measure(q); });
  };
  const Vector a = points.front(), b = farthest([&](const Vector&p) { return length(p - a); });
  if (!(length(b - a) > 0)) return {};
  const Vector along = normalised(b - a), p = perpendicular(along), q = cross(along, p);
  std::vector<Vector> out{p, -p, q, -q};
  const Vector c = farthest([&](const Vector& v) { return length(cross(v - a, along)); });
  const Vector normal = cross(c - a, along);
  if (length(normal) > 0) out.insert(out.end(), {normalised(normal), -normalised(normal)});
  return out;
}

}  // namespace

CoreOverlap polytope_overlap(const CorePair& pair) {
  const Core &a = pair.a, &b = pair.b;
  CoreOverlap best = face_overlap(pair);

  // Everything of b in the frame of a; its arcs and their normals as those of the mirrored shape.
  std::vector<Vector> directions_a, directions_b, normals_b, points_b, middles_b;
  for (const auto& p : a.arcs) directions_a.push_back(p.direction);
  for (const Vector& n : b.normals) normals_b.push_back(-(pair.b_in_a.rotation * n));
  for (const auto& q : b.arcs) {
    directions_b.push_back(pair.b_in_a.rotation * q.direction);
    points_b.push_back(pair.b_in_a * q.point);
    middles_b.push_back(normals_b[q.faces[0]] + normals_b[q.faces[1]]);
  }
  // Two arcs cross where each has its ends on two sides of the other's plane (and both on one half of the sphere).
  const std::size_t arcs = b.arcs.size(), normals = b.normals.size();
  static thread_local std::vector<double> ends_of_a, ends_of_b;
  dots(a.normals, Columns(directions_b), ends_of_a);  // [normal of a][arc of b]
  dots(directions_a, Columns(normals_b), ends_of_b);  // [arc of a][normal of b]
  for (std::size_t i = 0; i < a.arcs.size(); ++i) {
    const auto& p = a.arcs[i];
    const double *const p_from = &ends_of_a[p.faces[0] * arcs], *const p_to = &ends_of_a[p.faces[1] * arcs];
    const double* const q_ends = &ends_of_b[i * normals];
    for (std::size_t j = 0; j < arcs; ++j) {
      if (same_side(p_from[j], p_to[j])) continue;
      const auto& q = b.arcs[j];
      if (same_side(q_ends[q.faces[0]], q_ends[q.faces[1]])) continue;
      consider_edges(pair, p, directions_b[j], points_b[j], middles_b[j], best);
    }
  }
  return best;
}

CoreOverlap exhaustive_overlap(const CorePair& pair) {
  CoreOverlap best = face_overlap(pair);
  for (const auto& p : pair.a.arcs) {
    for (const auto& q : pair.b.arcs) {
      const Vector n = across(p.direction, pair.b_in_a.rotation * q.direction);
      if (dot(n, n) < 0.5) continue;
      consider(pair, n, best);
      consider(pair, -n, best);
    }
  }
  return best;
}

CoreOverlap grown_overlap(const CorePair& pair, double tolerance) {
  CoreOverlap best;
  best.depth = std::numeric_limits<double>::infinity();
  const auto farthest = [&](const Vector& n) {
    const Vector p = pair.a.support(n) - pair.b_in_a * pair.b.support(pair.b_in_a.rotation.inverse(-n));
    if (dot(n, p) < best.depth) best.depth = dot(n, p), best.normal = n;
    return p;
  };
  const auto surface_of_difference = [&] {
    std::vector<Vector> first;
    for (const Vector& n : directions_around()) first.push_back(farthest(n));
    // A needle or a plate can have all of these at few places: look across the line and the plane of those found.
    for (const Vector& n : directions_across(first)) first.push_back(farthest(n));
    for (const Vector& n : directions_across(first)) first.push_back(farthest(n));
    return ConvexSurface::around(first);
  };
  auto surface = surface_of_difference();
  best.error = surface ? std::numeric_limits<double>::infinity() : std::abs(best.depth);
  if (!surface) return best;  // flat: no depth in the direction across
  for (int step = 0; step < 2000; ++step) {
    const auto faces = surface->faces();
    const auto nearest =
        std::min_element(faces.begin(), faces.end(), [](const auto& p, const auto& q) { return p.offset < q.offset; });
    const Vector n = nearest->normal;
    const double inside = nearest->offset;
    const Vector p = farthest(n);
    best.error = std::max(0.0, best.depth - inside);
    if (best.depth - inside <= tolerance || best.depth < -tolerance) return best;
    if (!surface->add(p)) return best;
  }
  return best;
}

}  // namespace ringfence::reference
