#include "narrow_phase/query/mesh_distance.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>

#include "geometry/vector.hpp"

namespace ringfence::narrow_phase {
namespace {

using geometry::BoxGroup;
using geometry::MeshTree;
using geometry::tree_fanout;
using geometry::TreeNode;
using geometry::TriangleGroup;

struct AxisBox {
  Vec3d centre, half;
};

/// The box of a node; none if its lane is unused.
bool box_of(const BoxGroup& group, std::size_t lane, AxisBox& out) noexcept {
  out.half = {double{group.half[0][lane]}, double{group.half[1][lane]}, double{group.half[2][lane]}};
  out.centre = {double{group.centre[0][lane]}, double{group.centre[1][lane]}, double{group.centre[2][lane]}};
  return out.half.x >= 0;
}

/// Whether a lane is one of those past the last triangle of the mesh, which repeat it.
bool is_repeated(const TriangleGroup& leaf, std::size_t lane) noexcept {
  return lane > 0 && leaf.index[lane] == leaf.index[lane - 1];
}

std::array<Vec3d, 3> corners_of(const TriangleGroup& leaf, std::size_t lane) noexcept {
  std::array<Vec3d, 3> out;
  for (std::size_t i = 0; i < 3; ++i) {
    out[i] = {double{leaf.corner[i][0][lane]}, double{leaf.corner[i][1][lane]}, double{leaf.corner[i][2][lane]}};
  }
  return out;
}

AxisBox around(const std::array<Vec3d, 3>& corners) noexcept {
  const auto [p, q, r] = corners;
  const Vec3d low{std::min({p.x, q.x, r.x}), std::min({p.y, q.y, r.y}), std::min({p.z, q.z, r.z})};
  const Vec3d high{std::max({p.x, q.x, r.x}), std::max({p.y, q.y, r.y}), std::max({p.z, q.z, r.z})};
  return {(low + high) * 0.5, (high - low) * 0.5};
}

AxisBox around(const ConvexCore& core) {
  const Vec3d high{core.support({1, 0, 0}).x, core.support({0, 1, 0}).y, core.support({0, 0, 1}).z};
  const Vec3d low{core.support({-1, 0, 0}).x, core.support({0, -1, 0}).y, core.support({0, 0, -1}).z};
  return {(low + high) * 0.5, (high - low) * 0.5};
}

/// The distance of two boxes on the same axes; where they overlap, minus the depth. A lower bound of the distance of
/// what they contain.
double gap(const AxisBox& p, const AxisBox& q) noexcept {
  const Vec3d d{std::abs(p.centre.x - q.centre.x) - (p.half.x + q.half.x),
                std::abs(p.centre.y - q.centre.y) - (p.half.y + q.half.y),
                std::abs(p.centre.z - q.centre.z) - (p.half.z + q.half.z)};
  const Vec3d outside{std::max(d.x, 0.0), std::max(d.y, 0.0), std::max(d.z, 0.0)};
  const double most = std::max({d.x, d.y, d.z});
  return most > 0 ? length(outside) : most;
}

/// Up to four nodes or triangles, ordered by a lower bound of their distance.
struct Ranked {
  struct Entry {
    double bound;
    std::uint32_t index;
  };
  std::array<Entry, tree_fanout> entries;
  std::size_t count = 0;

  void insert(double bound, std::uint32_t index) noexcept {
    std::size_t at = count++;
    for (; at > 0 && bound < entries[at - 1].bound; --at) entries[at] = entries[at - 1];
    entries[at] = {bound, index};
  }
  const Entry* begin() const noexcept { return entries.data(); }
  const Entry* end() const noexcept { return entries.data() + count; }
};

/// The nearest pair of cores so far.
class NearestCores {
 public:
  /// Whether shapes that are at least `bound` apart can still matter.
  bool can_improve(double bound) const noexcept { return bound < distance_ && distance_ > 0; }

  void consider(const ConvexCore& a, const ConvexCore& b) {
    const CoreDistance found = core_distance(a, b, distance_);
    if (found.kind == CoreDistance::Kind::beyond) return;
    const double distance =
        found.kind == CoreDistance::Kind::touch ? 0 : std::max(0.0, found.upper - a.radius() - b.radius());
    if (distance < distance_) best_ = found, distance_ = distance;
  }

  double distance() const noexcept { return distance_; }  ///< metres; 0 if the shapes touch, infinite at first
  const CoreDistance& result() const noexcept { return best_; }

 private:
  CoreDistance best_;
  double distance_ = infinity;
};

/// The search for the triangle that is nearest to a convex shape.
class ConvexSearch {
 public:
  ConvexSearch(const MeshTree& tree, const ConvexCore& shape) : tree_(tree), shape_(shape), box_(around(shape)) {}

  CoreDistance run() {
    visit(tree_.root());
    return nearest_.result();
  }

 private:
  void visit(TreeNode node) {
    if (node.level == 0) return visit_leaf(tree_.leaf(node.index));
    const BoxGroup& group = tree_.boxes(node.level - 1, node.index);
    Ranked children;
    for (std::uint32_t lane = 0; lane < tree_fanout; ++lane) {
      AxisBox box;
      if (!box_of(group, lane, box)) continue;
      double bound = gap(box, box_) - shape_.radius();
      if (!nearest_.can_improve(bound)) continue;
      // The box around a long diagonal shape says little; the shape itself says more.
      if (shape_.reach() > 0) bound = std::max(bound, bound_of(box));
      children.insert(bound, node.index * static_cast<std::uint32_t>(tree_fanout) + lane);
    }
    for (const auto& child : children) {
      if (nearest_.can_improve(child.bound)) visit({node.level - 1, child.index});
    }
  }

  double bound_of(const AxisBox& box) const {
    Placement placement;
    placement.position = box.centre;
    const CoreDistance distance = core_distance(ConvexCore::box(box.half, placement), shape_, nearest_.distance());
    if (distance.kind == CoreDistance::Kind::touch) return -infinity;
    return distance.lower - shape_.radius();
  }

  void visit_leaf(const TriangleGroup& leaf) {
    Ranked triangles;
    for (std::uint32_t lane = 0; lane < tree_fanout; ++lane) {
      if (is_repeated(leaf, lane)) break;
      triangles.insert(gap(around(corners_of(leaf, lane)), box_) - shape_.radius(), lane);
    }
    for (const auto& triangle : triangles) {
      if (!nearest_.can_improve(triangle.bound)) continue;
      nearest_.consider(ConvexCore::triangle(corners_of(leaf, triangle.index).data()), shape_);
    }
  }

  const MeshTree& tree_;
  const ConvexCore& shape_;
  AxisBox box_;
  NearestCores nearest_;
};

/// A lower bound of the distance of a box on the frame's axes and a placed box: the widest gap along the six axes.
double gap(const AxisBox& p, const AxisBox& q, const Placement& placement) noexcept {
  const geometry::RotationD& r = placement.rotation;
  const Vec3d between = placement(q.centre) - p.centre;
  const double offset[3] = {between.x, between.y, between.z};
  const double half_p[3] = {p.half.x, p.half.y, p.half.z}, half_q[3] = {q.half.x, q.half.y, q.half.z};
  double most = -infinity;
  for (int i = 0; i < 3; ++i) {
    double along_p = std::abs(offset[i]) - half_p[i], along_q = -half_q[i], projected = 0;
    for (int j = 0; j < 3; ++j) {
      along_p -= std::abs(r.m[i][j]) * half_q[j];
      along_q -= std::abs(r.m[j][i]) * half_p[j];
      projected += r.m[j][i] * offset[j];
    }
    most = std::max({most, along_p, along_q + std::abs(projected)});
  }
  return most;
}

/// The search for the nearest triangles of two meshes.
class MeshSearch {
 public:
  MeshSearch(const MeshTree& a, const MeshTree& b, const Placement& placement) : a_(a), b_(b), placement_(placement) {}

  CoreDistance run() {
    const Node a{a_.root(), root_box(a_)}, b{b_.root(), root_box(b_)};
    visit(a, b);
    return nearest_.result();
  }

 private:
  struct Node {
    TreeNode node;
    AxisBox box;
  };

  static AxisBox root_box(const MeshTree& tree) noexcept {
    AxisBox box;
    box_of(tree.boxes_with(tree.root()), tree.root().index % tree_fanout, box);
    return box;
  }

  void visit(const Node& a, const Node& b) {
    if (a.node.level == 0 && b.node.level == 0) return visit_leaves(a.node.index, b.node.index);
    const bool descend_a = b.node.level == 0 || (a.node.level > 0 && length(a.box.half) >= length(b.box.half));
    const Node& parent = descend_a ? a : b;
    const MeshTree& tree = descend_a ? a_ : b_;
    const std::uint32_t level = parent.node.level - 1;
    const BoxGroup& group = tree.boxes(level, parent.node.index);
    Ranked children;
    std::array<AxisBox, tree_fanout> boxes;
    for (std::uint32_t lane = 0; lane < tree_fanout; ++lane) {
      if (!box_of(group, lane, boxes[lane])) continue;
      const double bound = descend_a ? gap(boxes[lane], b.box, placement_) : gap(a.box, boxes[lane], placement_);
      children.insert(bound, lane);
    }
    for (const auto& child : children) {
      if (!nearest_.can_improve(child.bound)) break;
      const Node next{{level, parent.node.index * static_cast<std::uint32_t>(tree_fanout) + child.index},
                      boxes[child.index]};
      descend_a ? visit(next, b) : visit(a, next);
    }
  }

  void visit_leaves(std::uint32_t a, std::uint32_t b) {
    const TriangleGroup &of_a = a_.leaf(a), &of_b = b_.leaf(b);
    std::array<std::array<Vec3d, 3>, tree_fanout> others;
    std::size_t count = 0;
    for (; count < tree_fanout && !is_repeated(of_b, count); ++count) {
      others[count] = corners_of(of_b, count);
      for (Vec3d& corner : others[count]) corner = placement_(corner);
    }
    for (std::size_t lane = 0; lane < tree_fanout && !is_repeated(of_a, lane); ++lane) {
      const std::array<Vec3d, 3> corners = corners_of(of_a, lane);
      const AxisBox box = around(corners);
      const ConvexCore triangle = ConvexCore::triangle(corners.data());
      for (std::size_t i = 0; i < count; ++i) {
        if (!nearest_.can_improve(gap(box, around(others[i])))) continue;
        nearest_.consider(triangle, ConvexCore::triangle(others[i].data()));
      }
    }
  }

  const MeshTree& a_;
  const MeshTree& b_;
  Placement placement_;
  NearestCores nearest_;
};

}  // namespace

CoreDistance mesh_distance(const geometry::Mesh& mesh, const ConvexCore& shape) {
  return ConvexSearch(mesh.tree(), shape).run();
}

CoreDistance mesh_distance(const geometry::Mesh& mesh, const geometry::Mesh& other, const Placement& placement) {
  return MeshSearch(mesh.tree(), other.tree(), placement).run();
}

}  // namespace ringfence::narrow_phase
