// Walks the tree of a mesh with a convex shape: sixteen boxes at a time, then sixteen triangles at a time, then each
// triangle that could be the deepest, exactly. Included once for each Highway target.
//
// The lanes only exclude. They compute in float with a margin far above the rounding error, and exclude what is
// separated or less deep than the deepest contact so far, but not ties. The remaining triangles are evaluated in double
// by functions of the two primitives alone. So the result, the deepest contact (of equal ones that with the lowest
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

#include "geometry/mesh_tree.hpp"
#include "narrow_phase/mesh/triangle.hpp"
#include "narrow_phase/narrow_phase.hpp"
#include "narrow_phase/simd/lanes-inl.hpp"

HWY_BEFORE_NAMESPACE();
namespace ringfence::narrow_phase::HWY_NAMESPACE {

/// Number of boxes or triangles that are tested together, for every vector width.
inline constexpr std::size_t group_size = 16;
/// The error of a bound in float, as part of the two sizes: more than twenty rounding errors.
inline constexpr double bound_margin = 2e-6;

using FloatLanes = hn::CappedTag<float, group_size>;

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

/// Loads columns of four floats side by side, from `lane` on as many as a vector holds; `block(i)` points to the i-th
/// column.
template <class D, class Block>
HWY_INLINE hn::Vec<D> load_blocks(D d, std::size_t lane, const Block& block) {
#if HWY_TARGET == HWY_SCALAR
  return hn::Load(d, block(lane / 4) + lane % 4);
#else
  const std::size_t i = lane / 4;
  const hn::CappedTag<float, 4> quarter;
  if constexpr (hn::MaxLanes(D()) == 16) {
    const hn::CappedTag<float, 8> half;
    return hn::Combine(d, hn::Combine(half, hn::Load(quarter, block(i + 3)), hn::Load(quarter, block(i + 2))),
                       hn::Combine(half, hn::Load(quarter, block(i + 1)), hn::Load(quarter, block(i))));
  } else if constexpr (hn::MaxLanes(D()) == 8) {
    return hn::Combine(d, hn::Load(quarter, block(i + 1)), hn::Load(quarter, block(i)));
  } else {
    static_assert(hn::MaxLanes(D()) == 4);
    return hn::Load(d, block(i));
  }
#endif
}

template <class D>
HWY_INLINE std::uint32_t bits_of_mask(D d, hn::Mask<D> mask) {
  std::uint8_t bytes[8] = {};
  hn::StoreMaskBits(d, mask, bytes);
  return bytes[0] | static_cast<std::uint32_t>(bytes[1]) << 8;
}

template <class D>
HWY_INLINE hn::Vec<D> at(D d, double value) {
  return hn::Set(d, static_cast<float>(value));
}

/// Whether `overlap` divided by the square root of `squared` is at least `least`, without computing the root: compares
/// squares that keep their sign.
template <class D>
HWY_INLINE hn::Mask<D> reaches(D d, hn::Vec<D> overlap, hn::Vec<D> squared, float least) {
  return overlap * hn::Abs(overlap) >= hn::Set(d, least * std::abs(least)) * squared;
}

/// The four boxes of each of up to four nodes, in lanes.
template <class D>
struct BoxLanes {
  Vector<D> centre, half;
};

/// Triangles in lanes.
template <class D>
struct TriangleLanes {
  Vector<D> corner[3];
  Vector<D> normal;
};

/// Walks the tree of one mesh. `Query` is a convex shape, placed in the mesh's axes. Its boxes(d, BoxLanes, floor) and
/// triangles(d, TriangleLanes, floor) return a mask of those that a contact of depth `floor` or more can reach; its
/// penetration(Triangle, at_least) is exact.
template <class Query>
class MeshWalk {
 public:
  MeshWalk(const geometry::MeshTree& tree, const Query& query, double margin)
      : tree_(tree), query_(query), deepest_(margin) {}

  /// Returns whether anything touches; then deepest() and triangle() describe the contact.
  bool run() {
    const geometry::TreeNode root = tree_.root();
    if (root.level == 0) {
      leaves_[0] = 0;
      test_leaves(1);
      return deepest_.found();
    }
    open_[count_++] = root;
    std::size_t leaves = 0;
    while (count_ > 0) {
      // Takes nodes of one level at a time. So no level ever has more than twelve nodes waiting, which bounds the
      // stack.
      geometry::TreeNode nodes[4];
      std::size_t taken = 0;
      do {
        nodes[taken++] = open_[--count_];
      } while (taken < 4 && count_ > 0 && open_[count_ - 1].level == nodes[0].level);
      const std::uint32_t level = nodes[0].level - 1;
      std::uint32_t children = test_boxes(nodes, taken);
      for (; children != 0; children &= children - 1) {
        const auto lane = static_cast<std::uint32_t>(__builtin_ctz(children));
        const std::uint32_t index = nodes[lane / 4].index * 4 + lane % 4;
        if (level > 0) {
          assert(count_ < std::size(open_));
          open_[count_++] = {level, index};
          continue;
        }
        leaves_[leaves++] = index;
        if (leaves == 4) {
          test_leaves(leaves);
          leaves = 0;
        }
      }
    }
    if (leaves > 0) test_leaves(leaves);
    return deepest_.found();
  }

  const Deepest& deepest() const { return deepest_; }
  const Triangle& triangle() const { return triangle_; }
  const WalkCounts& work() const { return work_; }

 private:
  std::uint32_t test_boxes(const geometry::TreeNode* nodes, std::size_t count) {
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
    for (std::size_t i = 0; i < 4; ++i) {
      const geometry::TreeNode node = nodes[std::min(i, count - 1)];
      groups[i] = &tree_.boxes(node.level - 1, node.index);
    }
    std::uint32_t bits = 0;
    for (std::size_t lane = 0; lane < 4 * count; lane += hn::Lanes(d)) {
      const auto column = [&](std::size_t k) {
        return Vector<FloatLanes>{
            load_blocks(d, lane, [&](std::size_t i) { return &groups[i]->centre[0][0] + 4 * k; }),
            load_blocks(d, lane, [&](std::size_t i) { return &groups[i]->centre[0][0] + 4 * (k + 1); }),
            load_blocks(d, lane, [&](std::size_t i) { return &groups[i]->centre[0][0] + 4 * (k + 2); })};
      };
      const BoxLanes<FloatLanes> in{column(0), column(3)};
      bits |= bits_of_mask(d, query_.boxes(d, in, deepest_.floor())) << lane;
    }
    return bits & ((std::uint32_t{1} << 4 * count) - 1);
  }

  void test_leaves(std::size_t count) {
    const FloatLanes d;
    const geometry::TriangleGroup* groups[4];
    for (std::size_t i = 0; i < 4; ++i) groups[i] = &tree_.leaf(leaves_[std::min(i, count - 1)]);
    std::uint32_t places = 0;
    for (std::size_t i = 0; i < count; ++i) places |= ((1u << triangles_of(*groups[i])) - 1) << 4 * i;
    work_.pass(geometry::tree_fanout * count, static_cast<std::size_t>(__builtin_popcount(places)));
    work_.evaluated += count;
    std::uint32_t bits = 0;
    for (std::size_t lane = 0; lane < 4 * count; lane += hn::Lanes(d)) {
      const auto column = [&](std::size_t k) {
        return Vector<FloatLanes>{
            load_blocks(d, lane, [&](std::size_t i) { return &groups[i]->corner[0][0][0] + 4 * k; }),
            load_blocks(d, lane, [&](std::size_t i) { return &groups[i]->corner[0][0][0] + 4 * (k + 1); }),
            load_blocks(d, lane, [&](std::size_t i) { return &groups[i]->corner[0][0][0] + 4 * (k + 2); })};
      };
      static_assert(offsetof(geometry::TriangleGroup, normal) == 36 * sizeof(float));
      const TriangleLanes<FloatLanes> in{{column(0), column(3), column(6)}, column(9)};
      bits |= bits_of_mask(d, query_.triangles(d, in, deepest_.floor())) << lane;
    }
    bits &= places;
    for (; bits != 0; bits &= bits - 1) {
      ++work_.evaluated;
      const auto lane = static_cast<std::uint32_t>(__builtin_ctz(bits));
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
  geometry::TreeNode open_[12 * geometry::max_tree_levels + 16];
  std::uint32_t leaves_[4];
  std::size_t count_ = 0;
};

}  // namespace ringfence::narrow_phase::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#endif
