#include "reference/shapes.hpp"

#include <algorithm>
#include <stdexcept>

#include "base/floating_point.hpp"
#include "reference/exact.hpp"
#include "reference/vector.hpp"

namespace ringfence::reference {
namespace {

Extents nothing() { return {{infinity, infinity, infinity}, {-infinity, -infinity, -infinity}}; }

Extents around(std::span<const Surface::Triangle> triangles) {
  Extents out = nothing();
  for (const auto& t : triangles) {
    for (const Vector& c : t.corners) include(out, c);
  }
  return out;
}

/// Orders triangles so that neighbours in the array are close in space, by recursive bisection along the longest side.
void sort_into_runs(std::span<Surface::Triangle> triangles) {
  if (triangles.size() <= Surface::run_length) return;
  const Extents e = around(triangles);
  const Vector side = e.upper - e.lower;
  const double Vector::*axis = side.x >= side.y && side.x >= side.z ? &Vector::x
                               : side.y >= side.z                   ? &Vector::y
                                                                    : &Vector::z;
  const std::size_t runs = (triangles.size() + Surface::run_length - 1) / Surface::run_length;
  const std::size_t half = (runs + 1) / 2 * Surface::run_length;
  std::nth_element(triangles.begin(), triangles.begin() + static_cast<std::ptrdiff_t>(half), triangles.end(),
                   [axis](const auto& p, const auto& q) {
                     return p.corners[0].*axis + p.corners[1].*axis + p.corners[2].*axis <
                            q.corners[0].*axis + q.corners[1].*axis + q.corners[2].*axis;
                   });
  sort_into_runs(triangles.first(half));
  sort_into_runs(triangles.subspan(half));
}

Surface surface_of(const TriangleMesh& mesh) {
  Surface out;
  for (std::size_t i = 0; i + 2 < mesh.indices.size(); i += 3) {
    Surface::Triangle t;
    for (std::size_t k = 0; k < 3; ++k) t.corners[k] = Vector(mesh.vertices.at(mesh.indices[i + k]));
    if (length(triangle_normal(t.corners[0], t.corners[1], t.corners[2])) > 0) out.triangles.push_back(t);
  }
  if (out.triangles.empty()) throw std::invalid_argument("mesh: no triangle has an area");
  out.extents = around(out.triangles);
  sort_into_runs(out.triangles);
  for (std::size_t i = 0; i < out.triangles.size(); i += Surface::run_length) {
    const std::size_t count = std::min(Surface::run_length, out.triangles.size() - i);
    out.runs.push_back(around(std::span(out.triangles).subspan(i, count)));
  }
  return out;
}

}  // namespace

void include(Extents& e, const Vector& p) {
  e.lower = {std::min(e.lower.x, p.x), std::min(e.lower.y, p.y), std::min(e.lower.z, p.z)};
  e.upper = {std::max(e.upper.x, p.x), std::max(e.upper.y, p.y), std::max(e.upper.z, p.z)};
}

Extents turned(const Extents& e, const Placement& p) {
  const Vector centre = p * ((e.lower + e.upper) * 0.5), half = (e.upper - e.lower) * 0.5;
  const auto& c = p.rotation.columns;
  const Vector reach{std::abs(c[0].x) * half.x + std::abs(c[1].x) * half.y + std::abs(c[2].x) * half.z,
                     std::abs(c[0].y) * half.x + std::abs(c[1].y) * half.y + std::abs(c[2].y) * half.z,
                     std::abs(c[0].z) * half.x + std::abs(c[1].z) * half.y + std::abs(c[2].z) * half.z};
  return {centre - reach, centre + reach};
}

Shapes::Shapes(std::span<const ShapeDescription> shapes) {
  for (const auto& shape : shapes) add(shape);
}

ShapeNumber Shapes::add(const ShapeDescription& shape) {
  const base::DefaultFloatingPoint floating_point;
  PreparedShape out;
  out.kind = static_cast<ShapeKind>(shape.index());
  if (const auto* mesh = std::get_if<TriangleMesh>(&shape)) {
    out.surface = surface_of(*mesh);
    for (const auto& t : out.surface.triangles) {
      for (const Vector& c : t.corners) out.bounding_radius = std::max(out.bounding_radius, length(c));
    }
  } else {
    out.core = core_of(shape);
    out.bounding_radius = out.core.reach + out.core.radius;
  }
  shapes_.push_back(std::move(out));
  return static_cast<ShapeNumber>(shapes_.size() - 1);
}

Extents extents_of(const PreparedShape& shape, const Placement& placement) {
  if (shape.kind == ShapeKind::mesh) return turned(shape.surface.extents, placement);
  const Core& core = shape.core;
  const auto least_and_most = [&](const Vector& axis, double offset) {
    const Vector local = placement.rotation.inverse(axis);
    return std::pair{offset - core.extent(-local) - core.radius, offset + core.extent(local) + core.radius};
  };
  const auto [x0, x1] = least_and_most({1, 0, 0}, placement.offset.x);
  const auto [y0, y1] = least_and_most({0, 1, 0}, placement.offset.y);
  const auto [z0, z1] = least_and_most({0, 0, 1}, placement.offset.z);
  return {{x0, y0, z0}, {x1, y1, z1}};
}

}  // namespace ringfence::reference
