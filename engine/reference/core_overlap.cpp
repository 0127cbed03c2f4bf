#include "reference/core_overlap.hpp"

#include <algorithm>
#include <cstddef>
#include <limits>
#include <vector>

#include "reference/convex_surface.hpp"

namespace ringfence::reference {
namespace {

// Dot products of unit vectors are precise to about 10^-16. A direction that is within this margin of being skipped is
// always tried.
constexpr double decision_margin = 1e-12;

/// Computes the overlap along `n` and stores it in `best` if it is smaller.
void consider(const CorePair& pair, const Vector& n, CoreOverlap& best) {
  const double depth = pair.overlap(n);
  if (depth < best.depth) best.depth = depth, best.normal = n;
}

/// One of the two shapes as a part of the Minkowski difference a - b, in the frame of a. Shape b is mirrored: its
/// points are negated, and its outward normals become directions from a to b.
struct Side {
  struct Edge {
    Vector direction, point;
    Vector ends[2];  // of its arc: the normals of the two adjacent faces
  };
  std::vector<Vector> normals;
  std::vector<Vector> opposite;  // for each normal, the point of the other shape that is farthest in the opposite
                                 // direction, mirrored for b
  std::vector<Edge> edges;       // only those that can hold the least depth
};

/// Tries the normals of all faces, and fills the normals and opposite points of both sides.
CoreOverlap face_overlap(const CorePair& pair, Side& of_a, Side& of_b) {
  CoreOverlap best;
  best.depth = std::numeric_limits<double>::infinity();
  const auto& rotation = pair.b_in_a.rotation;
  const auto keep = [&](Side& side, const Vector& n, const Vector& opposite, double depth) {
    side.normals.push_back(n);
    side.opposite.push_back(opposite);
    if (dot(n, n) < 0.5) return;  // the normal is zero where the area rounds to zero
    if (depth < best.depth) best.depth = depth, best.normal = n;
  };
  for (std::size_t i = 0; i < pair.a.normals.size(); ++i) {
    const Vector n = pair.a.normals[i];
    const Vector opposite = pair.b_in_a * pair.b.support(rotation.inverse(-n));
    keep(of_a, n, opposite, pair.a.offsets[i] - dot(n, opposite));
  }
  for (std::size_t i = 0; i < pair.b.normals.size(); ++i) {
    const Vector n = -(rotation * pair.b.normals[i]);
    const Vector opposite = pair.a.support(n);
    keep(of_b, n, -opposite, pair.b.offsets[i] - dot(n, pair.b_in_a.offset) + dot(n, opposite));
  }
  return best;
}

/// Whether the two shapes can overlap by less than `depth` in a direction on the edge's arc, as far as one point of
/// each shape can show.
///
/// For a point x of a and a point y of b, the overlap along n is at least n · (x - y). A unit vector on the arc is a
/// weighted sum of the ends of the arc, with weights that add up to at least one. So if n · (x - y) is positive at both
/// ends, it is nowhere on the arc less than the smaller of these two values.
bool can_be_less(const Side::Edge& edge, const Vector& opposite, double depth) {
  const Vector between = edge.point - opposite;
  return std::min(dot(edge.ends[0], between), dot(edge.ends[1], between)) < std::max(depth, 0.0);
}

/// Collects the edges whose arcs can hold a direction of less depth than `depth`. Edges of zero length are collected
/// only if `lengthless`: they produce a face of the Minkowski difference only if both shapes are flat.
void take_edges(const Core& core, const Placement& placement, double mirror, bool lengthless, double depth,
                Side& side) {
  for (const auto& arc : core.arcs) {
    if (!arc.has_length && !lengthless) continue;
    const Side::Edge edge{placement.rotation * arc.direction,
                          (placement * arc.point) * mirror,
                          {side.normals[arc.faces[0]], side.normals[arc.faces[1]]}};
    if (can_be_less(edge, side.opposite[arc.faces[0]], depth) &&
        can_be_less(edge, side.opposite[arc.faces[1]], depth)) {
      side.edges.push_back(edge);
    }
  }
}

/// Whether both ends of an arc are certainly on the same side of the plane perpendicular to `axis`.
bool same_side(const Side::Edge& arc, const Vector& axis) {
  return dot(arc.ends[0], axis) * dot(arc.ends[1], axis) > decision_margin;
}

/// The unit vector perpendicular to two edges, or zero if the edges are parallel within rounding. Parallel edges need
/// no direction of their own: the Minkowski difference has no face of any width between the adjacent faces, so the
/// normals of those faces are enough.
Vector across(const Vector& p, const Vector& q) {
  const Vector n = cross(p, q);
  const double sine = length(n);
  return sine > 1e-14 ? n * (1 / sine) : Vector{};
}

/// Tries the direction perpendicular to two edges if their arcs may cross there.
void consider_edges(const CorePair& pair, const Side::Edge& p, const Side::Edge& q, CoreOverlap& best) {
  if (same_side(p, q.direction) || same_side(q, p.direction)) return;
  Vector n = across(p.direction, q.direction);
  if (dot(n, n) < 0.5) return;
  for (int sense = 0; sense < 2; ++sense, n = -n) {
    if (dot(n, p.ends[0] + p.ends[1]) < -decision_margin || dot(n, q.ends[0] + q.ends[1]) < -decision_margin) continue;
    // The two edges alone already overlap this far along n; the whole shapes overlap at least as far.
    if (dot(n, p.point + q.point) < best.depth) consider(pair, n, best);
  }
}

/// The directions from the centre of a cube to its corners, edges and faces.
std::vector<Vector> directions_around() {
  std::vector<Vector> out;
  for (int i = 0; i < 27; ++i) {
    if (i != 13) out.push_back(normalised(Vector(i % 3 - 1, i / 3 % 3 - 1, static_cast<int>(i / 9) - 1)));
  }
  return out;
}

/// The directions perpendicular to the longest line and to the largest triangle of some points.
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
  Side of_a, of_b;
  CoreOverlap best = face_overlap(pair, of_a, of_b);
  const bool both_flat = pair.a.flat && pair.b.flat;
  take_edges(pair.a, {}, 1, both_flat, best.depth, of_a);
  take_edges(pair.b, pair.b_in_a, -1, both_flat, best.depth, of_b);
  for (const auto& p : of_a.edges) {
    for (const auto& q : of_b.edges) consider_edges(pair, p, q, best);
  }
  return best;
}

CoreOverlap exhaustive_overlap(const CorePair& pair) {
  CoreOverlap best;
  best.depth = std::numeric_limits<double>::infinity();
  for (const Vector& n : pair.a.normals) consider(pair, n, best);
  for (const Vector& n : pair.b.normals) consider(pair, -(pair.b_in_a.rotation * n), best);
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

CoreOverlap epa_overlap(const CorePair& pair, double tolerance) {
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
    // For a very long or very flat difference, all these points can coincide at a few places. So also search in the
    // directions perpendicular to their line and to their plane.
    for (const Vector& n : directions_across(first)) first.push_back(farthest(n));
    for (const Vector& n : directions_across(first)) first.push_back(farthest(n));
    return ConvexSurface::around(first);
  };
  auto surface = surface_of_difference();
  best.error = surface ? std::numeric_limits<double>::infinity() : std::abs(best.depth);
  if (!surface) return best;  // the difference is flat: the depth is 0 in the direction perpendicular to it
  for (int step = 0; step < 2000; ++step) {
    const auto faces = surface->faces();
    const auto nearest =
        std::min_element(faces.begin(), faces.end(), [](const auto& p, const auto& q) { return p.offset < q.offset; });
    const Vector n = nearest->normal;
    const double inside = nearest->offset;
    if (std::isinf(inside)) return best;
    const Vector p = farthest(n);
    best.error = std::max(0.0, best.depth - inside);
    if (best.depth - inside <= tolerance || best.depth < -tolerance) return best;
    // If no point lies beyond the face although the bounds differ, the face is a sliver, and rounding determines its
    // normal. The neighbouring faces give the same depth.
    if (!surface->add(p)) surface->exclude_face(static_cast<std::size_t>(nearest - faces.begin()));
  }
  return best;
}

}  // namespace ringfence::reference
