#include "geometry/mesh.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <string>

#include "geometry/vector.hpp"
#include "ringfence/error.hpp"

namespace ringfence::geometry {
namespace {

void check(const TriangleMesh& mesh) {
  if (mesh.indices.size() % 3 != 0) {
    throw Error("mesh: " + std::to_string(mesh.indices.size()) + " indices are not a multiple of 3");
  }
  if (mesh.indices.empty()) throw Error("mesh: no triangles");
  if (mesh.indices.size() / 3 > max_mesh_triangles) {
    throw Error("mesh: " + std::to_string(mesh.indices.size() / 3) + " triangles; at most " +
                std::to_string(max_mesh_triangles) + " are allowed, split or simplify it");
  }
  for (std::size_t i = 0; i < mesh.vertices.size(); ++i) {
    if (!is_finite(mesh.vertices[i])) throw Error("mesh: vertex " + std::to_string(i) + " is not finite");
  }
  for (std::size_t i = 0; i < mesh.indices.size(); ++i) {
    if (mesh.indices[i] >= mesh.vertices.size()) {
      throw Error("mesh: index " + std::to_string(mesh.indices[i]) + " of triangle " + std::to_string(i / 3) +
                  " is out of range, there are " + std::to_string(mesh.vertices.size()) + " vertices");
    }
  }
}

bool has_area(Vec3f p, Vec3f q, Vec3f r) noexcept {
  // Computed in double from floats, the result is zero only if the points are collinear.
  const Vec3d normal = cross(to_double(q) - to_double(p), to_double(r) - to_double(p));
  return dot(normal, normal) > 0.0;
}

float next_above(double value) noexcept {
  return std::nextafter(static_cast<float>(value), std::numeric_limits<float>::infinity());
}

}  // namespace

Mesh::Mesh(const TriangleMesh& description) {
  check(description);
  vertices_ = description.vertices;
  triangles_.reserve(description.indices.size() / 3);
  Vec3d low{1e300, 1e300, 1e300}, high{-1e300, -1e300, -1e300};
  double radius_squared = 0;
  for (std::size_t i = 0; i < description.indices.size(); i += 3) {
    const std::array<std::uint32_t, 3> triangle{description.indices[i], description.indices[i + 1],
                                                description.indices[i + 2]};
    if (!has_area(vertices_[triangle[0]], vertices_[triangle[1]], vertices_[triangle[2]])) {
      ++dropped_;
      continue;
    }
    triangles_.push_back(triangle);
    for (const std::uint32_t index : triangle) {
      const Vec3d p = to_double(vertices_[index]);
      low = {std::min(low.x, p.x), std::min(low.y, p.y), std::min(low.z, p.z)};
      high = {std::max(high.x, p.x), std::max(high.y, p.y), std::max(high.z, p.z)};
      radius_squared = std::max(radius_squared, dot(p, p));
    }
  }
  if (triangles_.empty()) {
    throw Error("mesh: all " + std::to_string(dropped_) + " triangles have zero area");
  }
  bounding_radius_ = next_above(std::sqrt(radius_squared));
  box_centre_ = to_float((low + high) * 0.5);
  const auto half_extent = [](double from, double to, float centre) {
    return next_above(std::max(to - double{centre}, double{centre} - from));
  };
  box_half_extents_ = {half_extent(low.x, high.x, box_centre_.x), half_extent(low.y, high.y, box_centre_.y),
                       half_extent(low.z, high.z, box_centre_.z)};
  tree_ = MeshTree(vertices_, triangles_);
  support_table_ = SupportTable(tree_);
}

void Mesh::extent(const Rotation& r, Vec3d& lower, Vec3d& upper) const noexcept {
  const Vec3d centre = to_double(box_centre_), half = to_double(box_half_extents_);
  const auto on_axis = [&](const float row[3], double& low, double& high) {
    const Vec3d axis{double{row[0]}, double{row[1]}, double{row[2]}};
    const double middle = dot(axis, centre);
    const double half_extent = dot(Vec3d{std::abs(axis.x), std::abs(axis.y), std::abs(axis.z)}, half);
    low = std::max(middle - half_extent, -support_table_.support_bound(-axis));
    high = std::min(middle + half_extent, support_table_.support_bound(axis));
  };
  on_axis(r.m[0], lower.x, upper.x);
  on_axis(r.m[1], lower.y, upper.y);
  on_axis(r.m[2], lower.z, upper.z);
}

}  // namespace ringfence::geometry
