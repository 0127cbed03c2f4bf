#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "geometry/mesh_tree.hpp"
#include "geometry/support_table.hpp"
#include "geometry/vector.hpp"
#include "ringfence/pose.hpp"
#include "ringfence/shape.hpp"

namespace ringfence::geometry {

/// A triangle surface, prepared once, then immutable: any thread may read it. Coordinates are relative to the shape's
/// origin, in metres. The constructor uses oneTBB's threads; the result has the same bits for any number of threads.
/// 10^6 triangles take 0.7 s on two cores.
class Mesh {
 public:
  /// Checks and copies `description`. Drops and counts triangles of zero area. Throws ringfence::Error if a vertex is
  /// not finite, an index is out of range, the number of indices is not a multiple of 3, there are more than
  /// max_mesh_triangles triangles, or none is left.
  explicit Mesh(const TriangleMesh& description);

  /// All vertices of the description, also those that no triangle uses.
  std::span<const Vec3f> vertices() const noexcept { return vertices_; }
  /// Three indices into vertices() for each triangle.
  std::span<const std::array<std::uint32_t, 3>> triangles() const noexcept { return triangles_; }
  /// Number of triangles of zero area in the description.
  std::size_t dropped_triangles() const noexcept { return dropped_; }
  /// A tree over triangles(). The numbers of triangles in the tree are indices into triangles().
  const MeshTree& tree() const noexcept { return tree_; }

  /// Radius of a ball around the coordinate origin that contains the surface; rounded up.
  float bounding_radius() const noexcept { return bounding_radius_; }
  /// Centre and half extents of a box, aligned with the shape's axes, that contains the surface. The half extents are
  /// rounded up.
  Vec3f box_centre() const noexcept { return box_centre_; }
  Vec3f box_half_extents() const noexcept { return box_half_extents_; }
  /// Computes the extent of the surface along the three rows of `r`, relative to the coordinate origin: on each axis
  /// the intersection of the extent of the rotated box and the extent from the support table. The result contains the
  /// surface, and is rarely more than 1 % longer.
  void extent(const Rotation& r, Vec3d& lower, Vec3d& upper) const noexcept;

 private:
  std::vector<Vec3f> vertices_;
  std::vector<std::array<std::uint32_t, 3>> triangles_;
  std::size_t dropped_ = 0;
  MeshTree tree_;
  SupportTable support_table_;
  float bounding_radius_ = 0;
  Vec3f box_centre_, box_half_extents_;
};

/// Maximum number of triangles of a mesh.
inline constexpr std::size_t max_mesh_triangles = 1'000'000;

}  // namespace ringfence::geometry
