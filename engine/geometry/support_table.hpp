#pragma once

#include <vector>

#include "geometry/mesh_tree.hpp"
#include "geometry/vector.hpp"

namespace ringfence::geometry {

/// How far a mesh reaches in any direction, from a table: an upper bound that costs the same for any mesh.
///
/// The table holds the reach, rounded up, in the directions of a grid on the six faces of a cube, 5 degrees apart.
/// Reach is convex and homogeneous, so between three of these directions it is at most the same mean of theirs. Exact
/// along the grid, the mesh's own axes among it; a ball comes out 0.2 % too large at most, a flat face seen from
/// between two directions of the grid up to 3 % of its width. In double, a fixed sequence of operations.
class SupportTable {
 public:
  SupportTable() = default;
  /// Uses oneTBB's threads; the same bits for any number of them.
  explicit SupportTable(const MeshTree& tree);

  /// At least the greatest direction · vertex; `direction` is not zero.
  double reach(Vec3d direction) const noexcept;

 private:
  std::vector<float> heights_;
};

}  // namespace ringfence::geometry
