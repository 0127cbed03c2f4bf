#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "base/aligned.hpp"
#include "ringfence/pose.hpp"

namespace ringfence::geometry {

/// Number of children of a node, and of triangles of a leaf.
inline constexpr std::size_t tree_fanout = 4;

/// The boxes of four sibling nodes on the mesh's axes, as columns of 16 bytes: one vector load each. If there are fewer
/// nodes, the unused lanes have large negative half extents, so nothing overlaps them.
struct alignas(16) BoxGroup {
  float centre[3][tree_fanout];
  float half[3][tree_fanout];
};
static_assert(sizeof(BoxGroup) == 96);

/// The four triangles of a leaf, as columns. Lanes past the last triangle of the mesh repeat it.
struct alignas(16) TriangleGroup {
  float corner[3][3][tree_fanout];  ///< [corner][axis]
  float normal[3]
              [tree_fanout];  ///< unit normal, computed in double: accurate to a rounding, also for very thin triangles
  std::uint32_t index[tree_fanout];  ///< number of the triangle in the mesh
};
static_assert(sizeof(TriangleGroup) == 208);

/// A node: its level (0: leaf) and its index within the level.
struct TreeNode {
  std::uint32_t level = 0;
  std::uint32_t index = 0;
};

/// A bounding volume tree over the triangles of a mesh, prepared once, then immutable.
///
/// Every node has four children, except for the last node of each level, and all leaves have the same depth. So no
/// pointers are needed: the children of node i are the nodes 4 i to 4 i + 3 of the level below, and their boxes form
/// one group. Boxes are rounded outwards. Construction halves the triangles along the longest side of the box of their
/// centres, at multiples of a power of four; ties are broken by number (a packed R-tree; Kamel and Faloutsos 1993).
///
/// The result has the same bits for any number of threads. Cost: 10^6 triangles take 0.5 s on two cores. Memory: 60
/// bytes for each triangle, 8 of them for boxes.
class MeshTree {
 public:
  MeshTree() = default;
  /// Precondition: at least one triangle, indices in range. Uses oneTBB's threads.
  MeshTree(std::span<const Vec3f> vertices, std::span<const std::array<std::uint32_t, 3>> triangles);

  TreeNode root() const noexcept { return {static_cast<std::uint32_t>(levels_.size() - 1), 0}; }
  /// Number of nodes of a level; level 0 are the leaves.
  std::size_t nodes(std::uint32_t level) const noexcept { return levels_[level].nodes; }
  /// The boxes of the nodes 4 group to 4 group + 3 of a level: the children of node `group` of the level above.
  const BoxGroup& boxes(std::uint32_t level, std::uint32_t group) const noexcept {
    return boxes_[levels_[level].first_group + group];
  }
  /// The group that contains the node's own box, in lane node.index % 4.
  const BoxGroup& boxes_with(TreeNode node) const noexcept {
    return boxes(node.level, static_cast<std::uint32_t>(node.index / tree_fanout));
  }
  const TriangleGroup& leaf(std::uint32_t index) const noexcept { return leaves_[index]; }
  std::span<const TriangleGroup> leaves() const noexcept { return leaves_; }
  std::span<const BoxGroup> all_boxes() const noexcept { return boxes_; }

  /// The maximum of direction · vertex over all triangles, in double. Skips subtrees by their boxes.
  double support(Vec3d direction) const noexcept;

 private:
  struct Level {
    std::size_t nodes = 0;
    std::size_t first_group = 0;
  };
  base::AlignedVector<TriangleGroup> leaves_;
  base::AlignedVector<BoxGroup> boxes_;
  std::vector<Level> levels_;
};

/// Maximum number of levels of a tree of `max_mesh_triangles` triangles; traversal stacks have this size.
inline constexpr std::size_t max_tree_levels = 11;

}  // namespace ringfence::geometry
