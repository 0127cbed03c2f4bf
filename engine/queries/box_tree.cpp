#include "queries/box_tree.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numeric>

#include "queries/tree_kernels.hpp"

namespace ringfence::queries {
namespace {

constexpr float float_infinity = std::numeric_limits<float>::infinity();

constexpr BoxGroup empty_group() noexcept {
  BoxGroup group{};
  for (auto& axis : group.lower) std::fill(std::begin(axis), std::end(axis), float_infinity);
  for (auto& axis : group.upper) std::fill(std::begin(axis), std::end(axis), -float_infinity);
  return group;
}

std::size_t groups_of(std::size_t nodes) noexcept { return (nodes + tree_width - 1) / tree_width; }

/// All groups of leaves; memory of builds on this thread.
std::span<const std::uint32_t> all_groups(std::size_t leaves) {
  thread_local std::vector<std::uint32_t> all;
  all.resize(groups_of(leaves));
  std::iota(all.begin(), all.end(), 0u);
  return all;
}

}  // namespace

void BoxTree::build(const RowOrder& leaves, const BoxConverter& box_of) {
  lay_out(leaves.size);
  fill(leaves, box_of, all_groups(leaves.size));
}

void BoxTree::reserve(std::size_t boxes) {
  const std::size_t groups = boxes / (tree_width - 1) + max_levels;
  groups_.reserve(groups + groups / 8);  // as lay_out()
}

BoxGroup* BoxTree::start(std::size_t size, const Vec3d& origin) {
  lay_out(size);
  origin_ = origin;
  size_ = size;
  return groups_.data();
}

void BoxTree::finish() { fill_levels(all_groups(size_)); }

/// Sets the levels for so many boxes, and the unused lanes of each.
void BoxTree::lay_out(std::size_t size) {
  level_count_ = 0;
  size_ = 0;
  std::size_t groups = 0;
  for (std::size_t nodes = size; nodes != 0; nodes = nodes == 1 ? 0 : groups_of(nodes)) {
    levels_[level_count_++] = groups;
    groups += groups_of(nodes);
    if (nodes <= tree_width) break;
  }
  // An eighth more, because the 64,000 boxes that are measured just miss a huge page: visits of 64 indexes of a history
  // would miss the TLB.
  groups_.reserve(groups + groups / 8);
  groups_.resize(groups);
  for (std::size_t level = 0; level < level_count_; ++level)
    groups_[levels_[level] + level_size(level) - 1] = empty_group();
}

/// Sets the boxes of some groups of leaves, and what is above them.
void BoxTree::fill(const RowOrder& leaves, const BoxConverter& box_of, std::span<const std::uint32_t> wanted) {
  origin_ = box_of.origin();
  size_ = leaves.size;
  choose_tree_kernels().fill_leaves(leaves, box_of, wanted, groups_.data());
  fill_levels(wanted);
}

/// Sets what is above some groups of leaves.
void BoxTree::fill_levels(std::span<const std::uint32_t> wanted) {
  cost_ = 0;
  for (std::size_t level = 1; level < level_count_; ++level) fill_level(level, wanted);
  if (level_count_ > 1) cost_ = surface_of(1) / static_cast<double>(size_);
}

double BoxTree::surface_of(std::size_t level) const noexcept {
  double sum = 0;
  for (std::size_t i = 0; i < groups_of(level_size(level - 1)); ++i) {
    const BoxGroup& group = this->level(level)[i];
    for (std::size_t lane = 0; lane < tree_width; ++lane) {
      double side[3];
      for (std::size_t a = 0; a < 3; ++a) {
        // An unused lane has none.
        side[a] = std::clamp(double{group.upper[a][lane]} - double{group.lower[a][lane]}, 0.0, 0x1p32);
      }
      sum += side[0] * side[1] + side[1] * side[2] + side[2] * side[0];
    }
  }
  return sum;
}

/// Sets the groups of nodes of a level above the `wanted` groups of leaves.
void BoxTree::fill_level(std::size_t level, std::span<const std::uint32_t> wanted) {
  const TreeKernels kernels = choose_tree_kernels();
  const BoxGroup* const below = groups_.data() + levels_[level - 1];
  BoxGroup* const out = groups_.data() + levels_[level];
  std::size_t last = ~std::size_t{0};
  for (const std::uint32_t leaves : wanted) {
    const std::size_t group = leaves >> (tree_width_log2 * level), first = group * tree_width;
    if (group == last) continue;
    last = group;
    kernels.fill_nodes(below + first, std::min(tree_width, level_size(level - 1) - first), out[group]);
  }
}

TreeBox BoxTree::box_of(const Vec3d& lower, const Vec3d& upper) const noexcept {
  const double low[3] = {lower.x, lower.y, lower.z}, high[3] = {upper.x, upper.y, upper.z};
  const double from[3] = {origin_.x, origin_.y, origin_.z};
  TreeBox out;
  for (std::size_t a = 0; a < 3; ++a) {
    const double rounding = 0x1p-50 * (std::abs(from[a]) + std::max(std::abs(low[a]), std::abs(high[a])));
    out.lower[a] = lower_side(low[a] - from[a] - rounding);
    out.upper[a] = upper_side(high[a] - from[a] + rounding);
  }
  return out;
}

Reach BoxTree::reach(const Vec3d& lower, const Vec3d& upper, const Vec3d& displacement) const noexcept {
  const double way[3] = {displacement.x, displacement.y, displacement.z};
  const TreeBox box = box_of(lower, upper);
  Reach out;
  for (std::size_t a = 0; a < 3; ++a) {
    out.lower[a] = box.lower[a];
    out.upper[a] = box.upper[a];
    // With a displacement of less than 10^-30 m, the place does not change.
    out.inverse[a] = static_cast<float>(1 / (std::abs(way[a]) < 1e-30 ? std::copysign(1e-30, way[a]) : way[a]));
  }
  return out;
}

}  // namespace ringfence::queries
