#include "facade/automatic_bounds.hpp"

#include <algorithm>
#include <vector>

#include "geometry/vector.hpp"

namespace ringfence::facade {

namespace {

constexpr double halves = 16;
constexpr double shortest_side = 16;  // metres

struct Range {
  double low, high;
};

/// The range of most values; sorts them. Precondition: there is one.
Range range_of_most(std::vector<double>& values) {
  std::sort(values.begin(), values.end());
  const std::size_t last = values.size() - 1;
  const double from = values[last / 4], to = values[3 * last / 4];
  const double reach = halves * (to - from);
  return {*std::lower_bound(values.begin(), values.end(), from - reach),
          *(std::upper_bound(values.begin(), values.end(), to + reach) - 1)};
}

}  // namespace

bool has_automatic_bounds(const WorldConfig& config) noexcept {
  return config.bounds_min == Vec3d{} && config.bounds_max == Vec3d{} && config.remote_nodes == nullptr;
}

bool choose_bounds(std::span<const nodes::Request> requests, WorldBounds& bounds) {
  std::vector<Vec3d> positions;
  for (const nodes::Request& request : requests) {
    if (request.kind == nodes::Request::Kind::spawn) {
      positions.push_back(request.spec.pose.position);
    }
  }
  return choose_bounds(positions, bounds);
}

bool choose_bounds(std::span<const Vec3d> positions, WorldBounds& bounds) {
  if (positions.empty()) {
    return false;
  }
  std::vector<double> values[3];
  for (const Vec3d& position : positions) {
    values[0].push_back(position.x);
    values[1].push_back(position.y);
    values[2].push_back(position.z);
  }
  const Range x = range_of_most(values[0]), y = range_of_most(values[1]), z = range_of_most(values[2]);
  const double longest = std::max({x.high - x.low, y.high - y.low, z.high - z.low});
  const double half = 0.5 * std::max(1.125 * longest, shortest_side);
  const Vec3d middle{0.5 * (x.low + x.high), 0.5 * (y.low + y.high), 0.5 * (z.low + z.high)};
  bounds.min = middle - Vec3d{half, half, half};
  bounds.max = middle + Vec3d{half, half, half};
  return true;
}

}  // namespace ringfence::facade
