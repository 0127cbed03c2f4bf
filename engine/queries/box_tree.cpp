#include "queries/box_tree.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numeric>

#include "queries/tree_kernels.hpp"

namespace ringfence::queries {
namespace {

constexpr float infinity = std::numeric_limits<float>::infinity();

float rounded_down(double value) noexcept {
  const auto nearest = static_cast<float>(value);
  return nearest - 0x1p-23f * std::abs(nearest);
}
float rounded_up(double value) noexcept { return -rounded_down(-value); }

constexpr BoxGroup empty_group() noexcept {
  BoxGroup group{};
  for (auto& axis : group.lower) std::fill(std::begin(axis), std::end(axis), infinity);
  for (auto& axis : group.upper) std::fill(std::begin(axis), std::end(axis), -infinity);
  return group;
}

std::size_t groups_of(std::size_t nodes) noexcept { return (nodes + tree_width - 1) / tree_width; }

/// Numbers of groups of leaves, ascending; memory of builds on this thread.
std::vector<std::uint32_t>& wanted_groups() noexcept {
  thread_local std::vector<std::uint32_t> mine;
  return mine;
}

}  // namespace

void BoxTree::build(const RowOrder& leaves, const BoxConverter& box_of) {
  levels_.clear();
  size_ = 0;
  std::size_t groups = 0;
  for (std::size_t nodes = leaves.size; nodes != 0; nodes = nodes == 1 ? 0 : groups_of(nodes)) {
    levels_.push_back(groups);
    groups += groups_of(nodes);
    if (nodes <= tree_width) break;
  }
  // An eighth more, because the 64,000 boxes that are measured just miss a huge page: visits of 64 indexes of a history
  // would miss the TLB.
  groups_.reserve(groups + groups / 8);
  groups_.resize(groups);
  for (std::size_t level = 0; level < levels_.size(); ++level)
    groups_[levels_[level] + level_size(level) - 1] = empty_group();
  std::vector<std::uint32_t>& all = wanted_groups();
  all.resize(groups_of(leaves.size));
  std::iota(all.begin(), all.end(), 0u);
  fill(leaves, box_of, all);
}

/// Sets the boxes of some groups of leaves, and what is above them.
void BoxTree::fill(const RowOrder& leaves, const BoxConverter& box_of, std::span<const std::uint32_t> wanted) {
  origin_ = box_of.origin();
  cost_ = 0;
  size_ = leaves.size;
  choose_tree_kernels().fill_leaves(leaves, box_of, wanted, groups_.data());
  for (std::size_t level = 1; level < levels_.size(); ++level) fill_level(level, wanted);
  if (levels_.size() > 1) cost_ = surface_of(1) / static_cast<double>(size_);
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

Reach BoxTree::reach(const Vec3d& lower, const Vec3d& upper, const Vec3d& displacement) const noexcept {
  const double low[3] = {lower.x, lower.y, lower.z}, high[3] = {upper.x, upper.y, upper.z};
  const double way[3] = {displacement.x, displacement.y, displacement.z};
  const double from[3] = {origin_.x, origin_.y, origin_.z};
  Reach out;
  for (std::size_t a = 0; a < 3; ++a) {
    const double rounding = 0x1p-50 * (std::abs(from[a]) + std::max(std::abs(low[a]), std::abs(high[a])));
    out.lower[a] = rounded_down(low[a] - from[a] - rounding);
    out.upper[a] = rounded_up(high[a] - from[a] + rounding);
    // With a displacement of less than 10^-30 m, the place does not change.
    out.inverse[a] = static_cast<float>(1 / (std::abs(way[a]) < 1e-30 ? std::copysign(1e-30, way[a]) : way[a]));
  }
  return out;
}

}  // namespace ringfence::queries
