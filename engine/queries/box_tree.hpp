#pragma once

#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <span>

#include "base/flat_list.hpp"
#include "base/prefetch.hpp"
#include "geometry/corner_box.hpp"
#include "queries/tree_box.hpp"
#include "ringfence/pose.hpp"

namespace ringfence::queries {

/// Number of children of a node of the tree.
inline constexpr std::size_t tree_width_log2 = 3, tree_width = 1 << tree_width_log2;
/// The largest number of levels: 8^10 boxes.
inline constexpr std::size_t max_levels = 10;

/// The boxes of eight siblings as columns, in metres from the tree's origin. An unused lane has a lower side of
/// infinity and an upper side of minus infinity.
struct alignas(32) BoxGroup {
  float lower[3][tree_width];
  float upper[3][tree_width];
};

/// The boxes that a query can reach: those that meet a box which moves along a line, or those near a point.
struct Reach {
  /// The moving box at its start, in metres from the tree's origin.
  float lower[3];
  float upper[3];
  /// 1 / its displacement, by axis; finite, and at least in the direction of a displacement of 0.
  float inverse[3];
  /// Of a search for a batch: the largest fraction that is of interest; near a point, the largest distance in metres.
  float limit = 1;
  float begin = 0;  ///< of a search for a batch: the fraction before which nothing is of interest
};

/// A bounding volume tree over boxes, built at once: every node but the last of each level has eight children, and all
/// leaves have the same depth, so there are no pointers. The children of node i of a level are the nodes 8 i to 8 i + 7
/// of the level below; those of level 0 are the boxes in the order in which they are given. That order decides how good
/// the tree is: see TreeOrder. (A packed R-tree; Kamel and Faloutsos 1993.)
///
/// Boxes are stored as floats, which are most precise near the origin.
///
/// Threads: build() by one; then const functions by any. Memory: kept between builds; 24 to 32 bytes a box, in huge
/// pages.
class BoxTree {
 public:
  /// Replaces the contents by the boxes of the rows `order[i]`.
  void build(std::span<const RowBounds> rows, std::span<const std::uint32_t> order, const BoxConverter& box_of) {
    build(RowOrder{rows, order.data(), order.size()}, box_of);
  }
  /// The same with the boxes of all rows, in their order.
  void build(std::span<const RowBounds> rows, const BoxConverter& box_of) {
    build(RowOrder{rows, nullptr, rows.size()}, box_of);
  }

  /// After a build of as many boxes with the same converter: sets the boxes of some groups of level 0, whose numbers
  /// ascend, and what is above them. The other boxes are as they were.
  void update(std::span<const RowBounds> rows, std::span<const std::uint32_t> order, const BoxConverter& box_of,
              std::span<const std::uint32_t> groups) {
    fill(RowOrder{rows, order.data(), order.size()}, box_of, groups);
  }

  /// Ensures room for so many boxes.
  void reserve(std::size_t boxes);
  /// Replaces the contents by `size` boxes around that origin, which the caller then sets by set_box() in what this
  /// returns. The tree is complete after finish().
  BoxGroup* start(std::size_t size, const Vec3d& origin);
  void finish();
  /// A side of a box in metres from the tree's origin, rounded outwards.
  static float lower_side(double metres) noexcept;
  static float upper_side(double metres) noexcept { return -lower_side(-metres); }

  std::size_t size() const noexcept { return size_; }  ///< number of boxes
  std::size_t levels() const noexcept { return level_count_; }
  /// The groups of a level; level 0 has the boxes themselves, the last level one group.
  const BoxGroup* level(std::size_t level) const noexcept { return groups_.data() + levels_[level]; }

  /// Loads what a search reads first into the cache. The tree itself is there already.
  void prefetch_top() const noexcept {
    if (!groups_.empty()) {
      base::prefetch_object(groups_[groups_.size() - 1]);
    }
  }

  /// Number of nodes, or of boxes at level 0, in the groups of a level.
  std::size_t nodes(std::size_t level) const noexcept { return level == 0 ? size() : level_size(level - 1); }

  /// What a box from `lower` to `upper` (metres) that moves by `displacement` can reach.
  Reach reach(const Vec3d& lower, const Vec3d& upper, const Vec3d& displacement) const noexcept;
  /// The box from `lower` to `upper` (metres), rounded outwards, as searches compare it.
  TreeBox box_of(const Vec3d& lower, const Vec3d& upper) const noexcept;
  /// The surface of the groups of eight boxes, halved, in square metres for each box; a measure of what searches cost.
  double cost() const noexcept { return cost_; }

 private:
  /// Number of groups of a level.
  std::size_t level_size(std::size_t level) const noexcept {
    return (level + 1 < level_count_ ? levels_[level + 1] : groups_.size()) - levels_[level];
  }
  void build(const RowOrder& leaves, const BoxConverter& box_of);
  void lay_out(std::size_t size);
  void fill(const RowOrder& leaves, const BoxConverter& box_of, std::span<const std::uint32_t> wanted);
  void fill_levels(std::span<const std::uint32_t> wanted);
  void fill_level(std::size_t level, std::span<const std::uint32_t> wanted);
  double surface_of(std::size_t level) const noexcept;

  Vec3d origin_;
  std::size_t size_ = 0;
  double cost_ = 0;
  base::FlatList<BoxGroup> groups_;
  std::size_t level_count_ = 0;
  std::array<std::size_t, max_levels> levels_{};  ///< first group of each level
};

inline float BoxTree::lower_side(double metres) noexcept {
  const auto nearest = static_cast<float>(metres);
  return nearest - 0x1p-23f * std::abs(nearest);
}

/// Sets box `i` of a tree with that origin, between BoxTree::start() and finish(): it is lane i % 8 of group i / 8.
inline void set_box(BoxGroup* groups, std::size_t i, const geometry::CornerBox& box, const Vec3d& origin) noexcept {
  BoxGroup& group = groups[i / tree_width];
  const std::size_t lane = i % tree_width;
  const Vec3d low = box.lower - origin, high = box.upper - origin;
  group.lower[0][lane] = BoxTree::lower_side(low.x);
  group.lower[1][lane] = BoxTree::lower_side(low.y);
  group.lower[2][lane] = BoxTree::lower_side(low.z);
  group.upper[0][lane] = BoxTree::upper_side(high.x);
  group.upper[1][lane] = BoxTree::upper_side(high.y);
  group.upper[2][lane] = BoxTree::upper_side(high.z);
}

}  // namespace ringfence::queries
