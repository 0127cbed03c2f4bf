#include "nodes/exchange/server/sensed_regions.hpp"

#include <algorithm>
#include <cmath>

namespace ringfence::nodes {

namespace {

/// Whether `at` is within `reach` of an interval. Sums are rounded, so far from the origin the reach is longer.
bool is_near(double lower, double upper, double at, double reach) noexcept {
  const double rounding = 0x1p-50 * (std::abs(at) + std::abs(lower) + std::abs(upper) + reach);
  return at >= lower - (reach + rounding) && at <= upper + (reach + rounding);
}

}  // namespace

void SensedRegions::start(std::size_t nodes) { boxes_.assign(nodes, Box()); }

void SensedRegions::add(NodeNumber node, const Vec3d& position) noexcept {
  Box& box = boxes_[node];
  box.lower = {std::min(box.lower.x, position.x), std::min(box.lower.y, position.y), std::min(box.lower.z, position.z)};
  box.upper = {std::max(box.upper.x, position.x), std::max(box.upper.y, position.y), std::max(box.upper.z, position.z)};
}

bool SensedRegions::reaches(NodeNumber node, const Vec3d& position, double radius, double distance) const noexcept {
  if (!any(node)) {
    return false;
  }
  // Exact tests find shapes that are apart by less than a small part of their size.
  const double reach = (radius + distance) * (1 + 0x1p-8);
  const Box& box = boxes_[node];
  return is_near(box.lower.x, box.upper.x, position.x, reach) && is_near(box.lower.y, box.upper.y, position.y, reach) &&
         is_near(box.lower.z, box.upper.z, position.z, reach);
}

}  // namespace ringfence::nodes
