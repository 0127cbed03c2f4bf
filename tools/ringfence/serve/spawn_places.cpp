#include "serve/spawn_places.hpp"

#include <algorithm>
#include <cmath>

namespace ringfence::tools {
namespace {

constexpr double spacing = 3;                         // metres between neighbouring places
constexpr double golden_angle = 2.39996322972865332;  // radians: no two places are in line (Vogel 1979)
constexpr double clearance = 0.9;                     // metres between the middle of an avatar and anything else
constexpr int attempts = 64;

}  // namespace

Vec3d SpawnPlaces::place(std::uint32_t index) const {
  const Vec3d &low = world_.config().bounds_min, &high = world_.config().bounds_max;
  const double reach = std::min(high.x - low.x, high.y - low.y) / 2 - spacing;
  // The spiral begins again in the middle when it reaches the bounds.
  const auto turns = static_cast<std::uint32_t>(std::max(1.0, reach * reach / (spacing * spacing)));
  const double radius = spacing * std::sqrt(index % turns + 1.0), angle = golden_angle * index;
  return {(low.x + high.x) / 2 + radius * std::cos(angle), (low.y + high.y) / 2 + radius * std::sin(angle),
          low.z + height_};
}

bool SpawnPlaces::is_free(const Snapshot& snapshot, const Vec3d& place) const {
  if (!snapshot) return true;
  NearestQuery query;
  query.point = place;
  query.distance = clearance;
  return !snapshot.nearest(query);
}

ObjectId SpawnPlaces::spawn(UserId user) {
  const Snapshot snapshot = world_.snapshot();
  ObjectSpec spec;
  spec.shape = shape_;
  spec.category = Category::avatar;
  spec.user = user;
  for (int attempt = 0; attempt < attempts; ++attempt) {
    spec.pose.position = place(next_++);
    if (is_free(snapshot, spec.pose.position)) break;
  }
  return world_.spawn(spec).id;
}

}  // namespace ringfence::tools
