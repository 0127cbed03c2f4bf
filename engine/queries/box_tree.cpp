#include "queries/box_tree.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

namespace ringfence::queries {
namespace {

constexpr float infinity = std::numeric_limits<float>::infinity();

float rounded_down(double value) noexcept {
  const auto nearest = static_cast<float>(value);
  return double{nearest} > value ? std::nextafter(nearest, -infinity) : nearest;
}
float rounded_up(double value) noexcept { return -rounded_down(-value); }

constexpr BoxGroup empty_group() noexcept {
  BoxGroup group{};
  for (auto& axis : group.lower) std::fill(std::begin(axis), std::end(axis), infinity);
  for (auto& axis : group.upper) std::fill(std::begin(axis), std::end(axis), -infinity);
  return group;
}

std::size_t groups_of(std::size_t nodes) noexcept { return (nodes + tree_width - 1) / tree_width; }

}  // namespace

void BoxTree::build(std::span<const geometry::Bounds> boxes, std::span<const float> margins,
                    const geometry::FixedSpace& space) {
  min_ = space.min();
  scale_ = space.scale();
  levels_.clear();
  std::size_t groups = 0;
  for (std::size_t nodes = boxes.size(); nodes != 0; nodes = nodes == 1 ? 0 : groups_of(nodes)) {
    levels_.push_back(groups);
    groups += groups_of(nodes);
    if (nodes <= tree_width) break;
  }
  groups_.resize(groups);
  size_ = boxes.size();
  cost_ = 0;
  if (boxes.empty()) return;
  fill_leaves(boxes, margins);
  std::size_t nodes = groups_of(boxes.size());
  for (std::size_t level = 1; level < levels_.size(); ++level, nodes = groups_of(nodes)) fill_level(level, nodes);
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

void BoxTree::fill_leaves(std::span<const geometry::Bounds> boxes, std::span<const float> margins) {
  constexpr std::uint32_t last_step = 0xffffffffu;
  const float scale[3] = {rounded_up(scale_.x), rounded_up(scale_.y), rounded_up(scale_.z)};
  // Conversions and sums of floats err by less than this part of their results.
  constexpr float low = 1 - 0x1p-21f, high = 1 + 0x1p-21f;
  groups_[(boxes.size() - 1) / tree_width] = empty_group();
  for (std::size_t i = 0; i < boxes.size(); ++i) {
    const geometry::Bounds& box = boxes[i];
    const float margin = margins[i];
    BoxGroup& group = groups_[i / tree_width];
    const std::size_t lane = i % tree_width;
    for (std::size_t a = 0; a < 3; ++a) {
      const float widening = margin * scale[a] + 1;
      const float lower = static_cast<float>(box.lower[a]) * low - widening * high;
      const float upper = static_cast<float>(box.upper[a]) * high + widening * high;
      group.lower[a][lane] = box.lower[a] == 0 ? -infinity : lower;
      group.upper[a][lane] = box.upper[a] == last_step ? infinity : upper;
    }
  }
}

void BoxTree::fill_level(std::size_t level, std::size_t nodes) {
  const BoxGroup* const below = groups_.data() + levels_[level - 1];
  BoxGroup* const out = groups_.data() + levels_[level];
  out[(nodes - 1) / tree_width] = empty_group();
  for (std::size_t i = 0; i < nodes; ++i) {
    BoxGroup& group = out[i / tree_width];
    const std::size_t lane = i % tree_width;
    for (std::size_t a = 0; a < 3; ++a) {
      group.lower[a][lane] = *std::min_element(std::begin(below[i].lower[a]), std::end(below[i].lower[a]));
      group.upper[a][lane] = *std::max_element(std::begin(below[i].upper[a]), std::end(below[i].upper[a]));
    }
  }
}

Reach BoxTree::reach(const Vec3d& lower, const Vec3d& upper, const Vec3d& displacement) const noexcept {
  const double low[3] = {lower.x, lower.y, lower.z}, high[3] = {upper.x, upper.y, upper.z};
  const double way[3] = {displacement.x, displacement.y, displacement.z};
  const double min[3] = {min_.x, min_.y, min_.z}, scale[3] = {scale_.x, scale_.y, scale_.z};
  Reach out;
  for (std::size_t a = 0; a < 3; ++a) {
    out.lower[a] = rounded_down((low[a] - min[a]) * scale[a] - 1);
    out.upper[a] = rounded_up((high[a] - min[a]) * scale[a] + 1);
    // A displacement of less than 10^-30 steps is within the margin of one step.
    const double steps = way[a] * scale[a];
    out.inverse[a] = static_cast<float>(1 / (std::abs(steps) < 1e-30 ? std::copysign(1e-30, steps) : steps));
  }
  return out;
}

}  // namespace ringfence::queries
