#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "base/aligned.hpp"
#include "ringfence/pose.hpp"

namespace ringfence::geometry {

/// Children of a node, and triangles of a leaf.
inline constexpr std::size_t tree_fanout = 4;

/// The boxes of four sibling nodes on the mesh's axes, as columns: one 16-byte load each. A place without a node has
/// half extents so far below zero that nothing overlaps it.
struct alignas(16) BoxGroup {
  float centre[3][tree_fanout];
  float half[3][tree_fanout];
};
static_assert(sizeof(BoxGroup) == 96);

/// The four triangles of a leaf as columns. The places past the last triangle of a mesh repeat it.
struct alignas(16) TriangleGroup {
  float corner[3][3][tree_fanout];   ///< [corner][axis]
  float normal[3][tree_fanout];      ///< unit, worked out in double: right to a rounding for needles too
  std::uint32_t index[tree_fanout];  ///< the triangle's number in the mesh
};
static_assert(sizeof(TriangleGroup) == 208);

/// A node: `level` 0 is a leaf, index counts within the level.
struct TreeNode {
  std::uint32_t level = 0;
  std::uint32_t index = 0;
};

/// A tree of boxes over the triangles of a mesh, prepared once, then immutable.
///
/// Every node has four children but the last of each level, and all leaves lie at the same depth, so there are no
/// pointers: the children of node i of a level are nodes 4 i to 4 i + 3 of the level below, and their boxes are one
/// group. Boxes hold their triangles: they are rounded outwards. Triangles are halved along the longest side of the
/// box of their centres, at multiples of a power of four (a packed R-tree; Kamel and Faloutsos 1993), ties by number.
///
/// The same bits whatever the number of threads that build it. Cost: 10^6 triangles take 0.5 s on two cores and 60
/// bytes each, of which 8 are boxes.
class MeshTree {
 public:
  MeshTree() = default;
  /// At least one triangle; indices in range. Uses oneTBB's threads.
  MeshTree(std::span<const Vec3f> vertices, std::span<const std::array<std::uint32_t, 3>> triangles);

  TreeNode root() const noexcept { return {static_cast<std::uint32_t>(levels_.size() - 1), 0}; }
  /// Nodes of a level; 0 has the leaves.
  std::size_t nodes(std::uint32_t level) const noexcept { return levels_[level].nodes; }
  /// The boxes of nodes 4 group to 4 group + 3 of a level: of the children of node `group` one level up.
  const BoxGroup& boxes(std::uint32_t level, std::uint32_t group) const noexcept {
    return boxes_[levels_[level].first_group + group];
  }
  /// The group that has the node's own box, in lane node.index % 4.
  const BoxGroup& boxes_with(TreeNode node) const noexcept {
    return boxes(node.level, static_cast<std::uint32_t>(node.index / tree_fanout));
  }
  const TriangleGroup& leaf(std::uint32_t index) const noexcept { return leaves_[index]; }
  std::span<const TriangleGroup> leaves() const noexcept { return leaves_; }
  std::span<const BoxGroup> all_boxes() const noexcept { return boxes_; }

  /// The greatest direction · vertex over all triangles, in double, by way of the boxes.
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

/// Levels that a tree of `max_mesh_triangles` has at most: what stacks of those who walk it are sized by.
inline constexpr std::size_t max_tree_levels = 11;

}  // namespace ringfence::geometry
