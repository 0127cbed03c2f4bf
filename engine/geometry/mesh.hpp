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

/// A triangle surface, prepared once, then immutable. Coordinates are the shape's, in metres. Preparing uses oneTBB's
/// threads and gives the same bits for any number of them; 10^6 triangles take 0.7 s on two cores.
class Mesh {
 public:
  /// Checks and copies. Triangles of zero area are dropped and counted. Throws ringfence::Error when a vertex is not
  /// finite, an index is out of range, their number is no multiple of 3, there are too many triangles or none is left.
  explicit Mesh(const TriangleMesh& description);

  std::span<const Vec3f> vertices() const noexcept { return vertices_; }
  /// Three indices into vertices() a triangle.
  std::span<const std::array<std::uint32_t, 3>> triangles() const noexcept { return triangles_; }
  /// Triangles of zero area that the description had.
  std::size_t dropped_triangles() const noexcept { return dropped_; }
  /// Over triangles(), whose numbers it uses.
  const MeshTree& tree() const noexcept { return tree_; }

  /// Of the ball about the coordinate origin that holds the surface, rounded up.
  float bounding_radius() const noexcept { return bounding_radius_; }
  /// The box on the shape's axes that holds the vertices in use: its centre and half extents, rounded outwards.
  Vec3f box_centre() const noexcept { return box_centre_; }
  Vec3f box_half_extents() const noexcept { return box_half_extents_; }
  /// The extent of the surface on the axes in the three rows of `r`, about the coordinate origin: what the turned box
  /// and the table of reaches agree on. It holds the surface, and is seldom a hundredth of its size larger.
  void extent(const Rotation& r, Vec3d& lower, Vec3d& upper) const noexcept;

 private:
  std::vector<Vec3f> vertices_;
  std::vector<std::array<std::uint32_t, 3>> triangles_;
  std::size_t dropped_ = 0;
  MeshTree tree_;
  SupportTable reaches_;
  float bounding_radius_ = 0;
  Vec3f box_centre_, box_half_extents_;
};

/// Triangles that a mesh may have.
inline constexpr std::size_t max_mesh_triangles = 1'000'000;

}  // namespace ringfence::geometry
