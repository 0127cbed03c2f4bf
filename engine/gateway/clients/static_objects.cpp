#include "gateway/clients/static_objects.hpp"

#include <algorithm>
#include <cmath>

#include "gateway/protocol/shape_radius.hpp"

namespace ringfence::gateway {

std::size_t StaticObjects::CellHash::operator()(const Cell& cell) const noexcept {
  const std::uint64_t h = static_cast<std::uint64_t>(cell.x) * 0x9e3779b97f4a7c15u ^
                          static_cast<std::uint64_t>(cell.y) * 0xc2b2ae3d27d4eb4fu;
  return h ^ h >> 32;
}

StaticObjects::Cell StaticObjects::cell_of(double x, double y) const noexcept {
  constexpr double farthest = 0x1p53;
  const auto index = [&](double coordinate) {
    return static_cast<std::int64_t>(std::floor(std::clamp(coordinate / cell_, -farthest, farthest)));
  };
  return {index(x), index(y)};
}

void StaticObjects::rebuild(std::span<const ObjectView> objects, const World& world, double interest) {
  entries_.clear();
  large_.clear();
  cells_.clear();
  cell_ = std::max(1.0, interest / 2);
  std::unordered_map<ShapeId, double> radii;
  for (const ObjectView& object : objects) {
    const ObjectSpec& spec = object.spec;
    if (spec.category != Category::fixed || !spec.enabled) continue;
    const auto [found, is_new] = radii.try_emplace(spec.shape, 0.0);
    if (is_new) found->second = shape_radius(world.shape(spec.shape));
    const auto index = static_cast<std::uint32_t>(entries_.size());
    entries_.push_back({object.id.number(), found->second, spec.pose});
    if (found->second > cell_) {
      large_.push_back(index);
    } else {
      cells_[cell_of(spec.pose.position.x, spec.pose.position.y)].push_back(index);
    }
  }
}

}  // namespace ringfence::gateway
