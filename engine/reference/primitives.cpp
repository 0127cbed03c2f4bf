#include "reference/primitives.hpp"

#include <algorithm>
#include <cstddef>
#include <vector>

#include "reference/vector.hpp"

namespace ringfence::reference {
namespace {

/// A primitive of one shape, and its box in the common frame.
struct Primitive {
  Extents box;
  const Core* core;                   // of a convex shape, else null
  const Surface::Triangle* triangle;  // of a mesh, else null
};

double gap(const Extents& p, const Extents& q) {
  const Vector d{std::max(p.lower.x - q.upper.x, q.lower.x - p.upper.x),
                 std::max(p.lower.y - q.upper.y, q.lower.y - p.upper.y),
                 std::max(p.lower.z - q.upper.z, q.lower.z - p.upper.z)};
  return std::max({d.x, d.y, d.z});
}

Extents box_of(const Surface::Triangle& t, const Placement& placement) {
  const Vector p = placement * t.corners[0], q = placement * t.corners[1], r = placement * t.corners[2];
  return {{std::min({p.x, q.x, r.x}), std::min({p.y, q.y, r.y}), std::min({p.z, q.z, r.z})},
          {std::max({p.x, q.x, r.x}), std::max({p.y, q.y, r.y}), std::max({p.z, q.z, r.z})}};
}

/// The primitives of a shape whose boxes come within `reach` of a box.
std::vector<Primitive> primitives_near(const PreparedShape& shape, const Placement& placement, const Extents& box,
                                       double reach) {
  if (shape.kind != ShapeKind::mesh) return {{extents_of(shape, placement), &shape.core, nullptr}};
  std::vector<Primitive> out;
  const Surface& surface = shape.surface;
  for (std::size_t run = 0; run < surface.runs.size(); ++run) {
    if (gap(turned(surface.runs[run], placement), box) > reach) continue;
    const std::size_t end = std::min((run + 1) * Surface::run_length, surface.triangles.size());
    for (std::size_t i = run * Surface::run_length; i < end; ++i) {
      const Extents e = box_of(surface.triangles[i], placement);
      if (!(gap(e, box) > reach)) out.push_back({e, nullptr, &surface.triangles[i]});
    }
  }
  return out;
}

Extents around(const std::vector<Primitive>& primitives) {
  Extents out = primitives.front().box;
  for (const Primitive& p : primitives) include(out, p.box.lower), include(out, p.box.upper);
  return out;
}

const Core& core_of(const Primitive& primitive, Core& scratch) {
  if (primitive.core) return *primitive.core;
  const auto& c = primitive.triangle->corners;
  set_triangle(scratch, c[0], c[1], c[2]);
  return scratch;
}

}  // namespace

void for_each_primitive_pair(const PreparedShape& a, const PreparedShape& b, const Placement& b_in_a, double reach,
                             const std::function<double(const Core&, const Core&)>& visit) {
  const auto in_a = primitives_near(a, {}, extents_of(b, b_in_a), reach);
  if (in_a.empty()) return;
  auto in_b = primitives_near(b, b_in_a, around(in_a), reach);
  std::sort(in_b.begin(), in_b.end(), [](const auto& p, const auto& q) { return p.box.lower.x < q.box.lower.x; });

  Core scratch_a, scratch_b;
  double interest = -infinity;
  for (const Primitive& p : in_a) {
    const Core* core_a = nullptr;
    for (const Primitive& q : in_b) {
      if (q.box.lower.x - p.box.upper.x > reach) break;
      const double apart = gap(p.box, q.box);
      // The depth of an overlap is at most the overlap of the boxes along each axis.
      if (apart > reach || -apart < interest) continue;
      if (!core_a) core_a = &core_of(p, scratch_a);
      interest = visit(*core_a, core_of(q, scratch_b));
    }
  }
}

}  // namespace ringfence::reference
