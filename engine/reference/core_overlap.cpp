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

bool same_side(double p, double q) { return (p > unsure && q > unsure) || (p < -unsure && q < -unsure); }

/// dots[i * normals + j] = arc i of one · normal j of the other.
std::vector<double> arcs_by_normals(const Core& core, const std::vector<Vector>& normals) {
  std::vector<double> out;
  out.reserve(core.arcs.size() * normals.size());
  for (const auto& arc : core.arcs) {
    for (const Vector& n : normals) out.push_back(dot(arc.direction, n));
  }
  return out;
}

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
  const Placement a_in_b = inverse(pair.b_in_a);
  std::vector<Vector> normals_a, normals_b;  // each in the other's frame
  for (const Vector& n : a.normals) normals_a.push_back(a_in_b.rotation * n);
  for (const Vector& n : b.normals) normals_b.push_back(pair.b_in_a.rotation * n);
  const auto a_dots = arcs_by_normals(a, normals_b), b_dots = arcs_by_normals(b, normals_a);

  struct Edge {
    Vector direction, point, middle;
  };
  std::vector<Edge> edges_b;  // in the frame of a, the arc of the mirrored shape
  for (const auto& q : b.arcs) {
    edges_b.push_back(
        {pair.b_in_a.rotation * q.direction, pair.b_in_a * q.point, -(normals_b[q.faces[0]] + normals_b[q.faces[1]])});
  }
  for (std::size_t i = 0; i < a.arcs.size(); ++i) {
    const auto& p = a.arcs[i];
    const double* const p_dots = a_dots.data() + i * b.normals.size();
    for (std::size_t j = 0; j < b.arcs.size(); ++j) {
      const auto& q = b.arcs[j];
      if (same_side(p_dots[q.faces[0]], p_dots[q.faces[1]])) continue;
      const double* const q_dots = b_dots.data() + j * a.normals.size();
      if (same_side(q_dots[p.faces[0]], q_dots[p.faces[1]])) continue;
      consider_edges(pair, p, edges_b[j].direction, edges_b[j].point, edges_b[j].middle, best);
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
