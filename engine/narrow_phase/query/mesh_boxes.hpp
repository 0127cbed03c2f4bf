#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>

#include "geometry/corner_box.hpp"
#include "geometry/mesh_tree.hpp"
#include "geometry/vector.hpp"

namespace ringfence::narrow_phase {

using geometry::CornerBox;

/// The box of a node. Returns false if the lane is unused. It contains the boxes of all triangles below it, also after
/// rounding: a float's difference in double rounds to no less than a float that it does not exceed.
inline bool box_of_node(const geometry::BoxGroup& group, std::size_t lane, CornerBox& out) noexcept {
  const Vec3d half{double{group.half[0][lane]}, double{group.half[1][lane]}, double{group.half[2][lane]}};
  if (half.x < 0) return false;
  const Vec3d centre{double{group.centre[0][lane]}, double{group.centre[1][lane]}, double{group.centre[2][lane]}};
  out = {centre - half, centre + half};
  return true;
}

/// Whether a lane is one of those past the last triangle of the mesh, which repeat it.
inline bool is_repeated_triangle(const geometry::TriangleGroup& leaf, std::size_t lane) noexcept {
  return lane > 0 && leaf.index[lane] == leaf.index[lane - 1];
}

inline std::array<Vec3d, 3> corners_of_triangle(const geometry::TriangleGroup& leaf, std::size_t lane) noexcept {
  std::array<Vec3d, 3> out;
  for (std::size_t i = 0; i < 3; ++i) {
    out[i] = {double{leaf.corner[i][0][lane]}, double{leaf.corner[i][1][lane]}, double{leaf.corner[i][2][lane]}};
  }
  return out;
}

inline CornerBox box_of_triangle(const std::array<Vec3d, 3>& corners) noexcept {
  const auto& [p, q, r] = corners;
  return {{std::min({p.x, q.x, r.x}), std::min({p.y, q.y, r.y}), std::min({p.z, q.z, r.z})},
          {std::max({p.x, q.x, r.x}), std::max({p.y, q.y, r.y}), std::max({p.z, q.z, r.z})}};
}

/// Visits the triangles of a mesh in a best-first order, until none can improve the result.
///
/// `bound(box)` is a number below which no result in the box can lie, or infinity if the box has none. It has to be
/// monotonic as computed: for a box within another it is not less. `visit(corners, leaf, lane, bound)` tests a triangle
/// and returns the largest bound that is of interest from now on; `most` is the first. If no result is less than the
/// bound of the triangle's own box, the best result does not depend on the order of visits. No allocation.
template <class Bound, class Visit>
void visit_triangles(const geometry::MeshTree& tree, double most, const Bound& bound, const Visit& visit) {
  struct Entry {
    double bound;
    geometry::TreeNode node;
  };
  constexpr double none = std::numeric_limits<double>::infinity();
  constexpr std::size_t fanout = geometry::tree_fanout;
  std::array<Entry, geometry::max_tree_levels * fanout> stack;
  std::size_t size = 0;
  stack[size++] = {-none, tree.root()};
  while (size > 0) {
    const Entry entry = stack[--size];
    if (entry.bound > most) continue;
    if (entry.node.level == 0) {
      const geometry::TriangleGroup& leaf = tree.leaf(entry.node.index);
      for (std::size_t lane = 0; lane < fanout && !is_repeated_triangle(leaf, lane); ++lane) {
        const std::array<Vec3d, 3> corners = corners_of_triangle(leaf, lane);
        const double of_triangle = bound(box_of_triangle(corners));
        if (of_triangle <= most && of_triangle < none) most = visit(corners, leaf, lane, of_triangle);
      }
      continue;
    }
    const geometry::BoxGroup& group = tree.boxes(entry.node.level - 1, entry.node.index);
    const std::size_t first = size;
    for (std::size_t lane = 0; lane < fanout; ++lane) {
      CornerBox box;
      if (!box_of_node(group, lane, box)) continue;
      const double of_child = bound(box);
      if (!(of_child <= most && of_child < none)) continue;
      // The child with the least bound is on top of the stack.
      std::size_t at = size++;
      for (; at > first && stack[at - 1].bound < of_child; --at) stack[at] = stack[at - 1];
      stack[at] = {of_child, {entry.node.level - 1, static_cast<std::uint32_t>(entry.node.index * fanout + lane)}};
    }
  }
}

}  // namespace ringfence::narrow_phase
