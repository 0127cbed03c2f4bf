// Walks the tree of a mesh with a convex shape: sixteen boxes at a time, then sixteen triangles at a time, then each
// triangle that could be the deepest, exactly. Included once for each Highway target.
//
// The lanes only exclude, by upper bounds of the depth. They compute in float with a margin far above the rounding
// error, and exclude what is separated or less deep than the deepest contact so far, but not ties. What has the largest
// bound comes first, because its depth may exclude the others. The remaining triangles are evaluated in double by
// functions of the two primitives alone. So the result, the deepest contact (of equal ones that with the lowest
// number), does not depend on the vector width, the order or the structure of the tree.

#if defined(RINGFENCE_NARROW_PHASE_MESH_WALK_INL) == defined(HWY_TARGET_TOGGLE)
#ifdef RINGFENCE_NARROW_PHASE_MESH_WALK_INL
#undef RINGFENCE_NARROW_PHASE_MESH_WALK_INL
#else
#define RINGFENCE_NARROW_PHASE_MESH_WALK_INL
#endif

#include <algorithm>
#include <cassert>
#include <cstddef>
#include <cstdint>
#include <limits>

#include "geometry/mesh_tree.hpp"
#include "narrow_phase/mesh/mesh_lanes-inl.hpp"
#include "narrow_phase/mesh/triangle.hpp"
#include "narrow_phase/narrow_phase.hpp"

HWY_BEFORE_NAMESPACE();
namespace ringfence::narrow_phase::HWY_NAMESPACE {

/// Counts the work of a walk for the counters.
struct WalkCounts {
  std::size_t lanes = 0, filled = 0;
  std::size_t evaluated = 0;  ///< nodes (or pairs of nodes) opened, and primitives (or pairs) evaluated in double

  /// Counts a pass over `count` slots in groups of up to `group_size`, of which `used` are filled.
  HWY_INLINE void pass(std::size_t count, std::size_t used) {
    constexpr std::size_t width = hn::MaxLanes(FloatLanes());
    lanes += (count + width - 1) / width * width;
    filled += used;
  }
  void add_to(KindCounters& counters) const {
    counters.lanes += lanes;
    counters.lanes_filled += filled;
    counters.iterations += evaluated;
  }
};

/// Number of nodes in a group of four siblings: fewer than four only at the end of a level.
HWY_INLINE std::size_t nodes_of(const geometry::MeshTree& tree, std::uint32_t level, std::uint32_t group) {
  return std::min(geometry::tree_fanout, tree.nodes(level) - geometry::tree_fanout * group);
}

/// Number of triangles in a leaf. The free slots of the last leaf repeat the last triangle and are ignored.
HWY_INLINE std::size_t triangles_of(const geometry::TriangleGroup& leaf) {
  std::size_t count = geometry::tree_fanout;
  while (count > 1 && leaf.index[count - 1] == leaf.index[count - 2]) --count;
  return count;
}

/// The deepest contact found so far, and the depth that others have to reach.
class Deepest {
 public:
  explicit Deepest(double margin) : margin_(margin), floor_(static_cast<float>(-margin)) {}

  bool found() const { return penetration_.depth >= 0; }
  const Penetration& penetration() const { return penetration_; }
  double at_least() const { return std::max(penetration_.depth, 0.0); }
  /// Candidates whose bound is below this are excluded.
  float floor() const { return floor_; }

  /// Takes a contact if it is the deepest so far; `key` decides between equal depths. Returns whether it was taken.
  bool take(const Penetration& penetration, std::uint64_t key) {
    if (!(penetration.depth >= 0) || penetration.depth < penetration_.depth ||
        (penetration.depth == penetration_.depth && key > key_))
      return false;
    penetration_ = penetration;
    key_ = key;
    // The error of rounding to float is far below the margin.
    floor_ = static_cast<float>(penetration.depth - margin_);
    return true;
  }

 private:
  Penetration penetration_;
  std::uint64_t key_ = 0;
  double margin_;
  float floor_;
};

/// Walks the tree of one mesh. `Query` is a convex shape, placed in the mesh's axes. Its boxes(d, BoxLanes, floor) and
/// triangles(d, TriangleLanes, floor) return upper bounds of the depth, which need not be right where they are below
/// `floor`; its penetration(Triangle, at_least) is exact.
template <class Query>
class MeshWalk {
 public:
  MeshWalk(const geometry::MeshTree& tree, const Query& query, double margin)
      : tree_(tree), query_(query), deepest_(margin) {}

  /// Returns whether anything touches; then deepest() and triangle() describe the contact.
  bool run() {
    const geometry::TreeNode root = tree_.root();
    if (root.level == 0) {
      const geometry::TriangleGroup* groups[4] = {&tree_.leaf(0)};
      test_triangles(groups, 1);
      return deepest_.found();
    }
    open_[count_++] = {root.level, root.index, std::numeric_limits<float>::infinity()};
    geometry::TreeNode nodes[4];
    while (const std::size_t taken = take_nodes(nodes)) {
      BoundedLanes children = test_boxes(nodes, taken);
      nodes[0].level == 1 ? test_leaves(nodes, children) : open(nodes, children);
    }
    return deepest_.found();
  }

  const Deepest& deepest() const { return deepest_; }
  const Triangle& triangle() const { return triangle_; }
  const WalkCounts& work() const { return work_; }

 private:
  /// A node that waits, and the bound of its box. Not initialised, because most of the stack is never used.
  struct OpenNode {
    std::uint32_t level, index;
    float bound;
  };

  /// Takes up to four waiting nodes that are not excluded by now, all of one level. Because they are of one level, no
  /// level ever has more than twelve nodes waiting, which bounds the stack. Returns their number; 0: none waits.
  std::size_t take_nodes(geometry::TreeNode* nodes) {
    std::size_t taken = 0;
    while (taken < 4 && count_ > 0) {
      const OpenNode& last = open_[count_ - 1];
      if (taken > 0 && last.level != nodes[0].level) break;
      --count_;
      if (last.bound >= deepest_.floor()) nodes[taken++] = {last.level, last.index};
    }
    return taken;
  }

  static std::uint32_t child(const geometry::TreeNode* nodes, std::uint32_t lane) {
    return nodes[lane / 4].index * 4 + lane % 4;
  }

  /// Lets the children wait, the one with the largest bound on top of the stack.
  void open(const geometry::TreeNode* nodes, BoundedLanes& children) {
    count_ += static_cast<std::size_t>(__builtin_popcount(children.bits));
    assert(count_ <= std::size(open_));
    for (OpenNode* to = open_ + count_; children.bits != 0;) {
      const std::uint32_t lane = children.take_largest();
      *--to = {nodes[0].level - 1, child(nodes, lane), children.bound[lane]};
    }
  }

  BoundedLanes test_boxes(const geometry::TreeNode* nodes, std::size_t count) {
    const FloatLanes d;
    const geometry::BoxGroup* groups[4];
    const std::uint32_t level = nodes[0].level - 1;
    const std::size_t last = tree_.nodes(level);
    std::size_t boxes = 0;
    for (std::size_t i = 0; i < count; ++i) {
      boxes += std::min(geometry::tree_fanout, last - geometry::tree_fanout * nodes[i].index);
    }
    work_.pass(geometry::tree_fanout * count, boxes);
    work_.evaluated += count;
    for (std::size_t i = 0; i < 4; ++i) groups[i] = &tree_.boxes(level, nodes[std::min(i, count - 1)].index);
    BoundedLanes result;
    for (std::size_t lane = 0; lane < 4 * count; lane += hn::Lanes(d)) {
      const auto column = [&](std::size_t k) {
        return Vector<FloatLanes>{
            load_blocks(d, lane, [&](std::size_t i) { return &groups[i]->centre[0][0] + 4 * k; }),
            load_blocks(d, lane, [&](std::size_t i) { return &groups[i]->centre[0][0] + 4 * (k + 1); }),
            load_blocks(d, lane, [&](std::size_t i) { return &groups[i]->centre[0][0] + 4 * (k + 2); })};
      };
      const BoxLanes<FloatLanes> in{column(0), column(3)};
      result.put(d, lane, query_.boxes(d, in, deepest_.floor()), deepest_.floor());
    }
    result.bits &= (std::uint32_t{1} << 4 * count) - 1;
    return result;
  }

  /// Tests the leaves among the children, four at a time.
  void test_leaves(const geometry::TreeNode* nodes, BoundedLanes& children) {
    while (children.bits != 0) {
      const geometry::TriangleGroup* groups[4];
      std::size_t count = 0;
      while (count < 4 && children.bits != 0) {
        const std::uint32_t lane = children.take_largest();
        if (children.bound[lane] < deepest_.floor())
          children.bits = 0;
        else
          groups[count++] = &tree_.leaf(child(nodes, lane));
      }
      if (count > 0) test_triangles(groups, count);
    }
  }

  /// `groups` has room for four.
  void test_triangles(const geometry::TriangleGroup** groups, std::size_t count) {
    const FloatLanes d;
    std::fill(groups + count, groups + 4, groups[count - 1]);
    std::uint32_t places = 0;
    for (std::size_t i = 0; i < count; ++i) places |= ((1u << triangles_of(*groups[i])) - 1) << 4 * i;
    work_.pass(geometry::tree_fanout * count, static_cast<std::size_t>(__builtin_popcount(places)));
    work_.evaluated += count;
    BoundedLanes result;
    for (std::size_t lane = 0; lane < 4 * count; lane += hn::Lanes(d)) {
      const auto column = [&](std::size_t k) {
        return Vector<FloatLanes>{
            load_blocks(d, lane, [&](std::size_t i) { return &groups[i]->corner[0][0][0] + 4 * k; }),
            load_blocks(d, lane, [&](std::size_t i) { return &groups[i]->corner[0][0][0] + 4 * (k + 1); }),
            load_blocks(d, lane, [&](std::size_t i) { return &groups[i]->corner[0][0][0] + 4 * (k + 2); })};
      };
      static_assert(offsetof(geometry::TriangleGroup, normal) == 36 * sizeof(float));
      const TriangleLanes<FloatLanes> in{{column(0), column(3), column(6)}, column(9)};
      result.put(d, lane, query_.triangles(d, in, deepest_.floor()), deepest_.floor());
    }
    result.bits &= places;
    while (result.bits != 0) {
      const std::uint32_t lane = result.take_largest();
      if (result.bound[lane] < deepest_.floor()) return;
      ++work_.evaluated;
      const geometry::TriangleGroup& leaf = *groups[lane / 4];
      const Triangle triangle = triangle_of(leaf, lane % 4);
      if (deepest_.take(query_.penetration(triangle, deepest_.at_least()), leaf.index[lane % 4])) triangle_ = triangle;
    }
  }

  const geometry::MeshTree& tree_;
  const Query& query_;
  Deepest deepest_;
  WalkCounts work_;
  Triangle triangle_;
  OpenNode open_[12 * geometry::max_tree_levels + 16];
  std::size_t count_ = 0;
};

}  // namespace ringfence::narrow_phase::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#endif
