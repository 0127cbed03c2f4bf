#include "queries/tree_space.hpp"

#include <algorithm>
#include <array>

#include "geometry/vector.hpp"

namespace ringfence::queries {
namespace {

constexpr std::size_t most_samples = 256;

/// The range of most values, extended by several times its length, since a sample does not have the outermost values.
void widen_range(std::span<double> values, double& lower, double& upper) {
  std::sort(values.begin(), values.end());
  const std::size_t skipped = values.size() / 16;
  const double first = values[skipped], last = values[values.size() - 1 - skipped];
  const double margin = 16 * (last - first) + 1000;
  lower = std::max(lower, first - margin);
  upper = std::min(upper, last + margin);
}

}  // namespace

geometry::FixedSpace choose_space(std::span<const FrameObject> rows, std::span<const std::uint32_t> objects,
                                  const geometry::ShapeRow* shapes) {
  if (objects.empty()) return {{0, 0, 0}, {1, 1, 1}};
  Vec3d min = rows[objects[0]].pose.position, max = min;
  float radius = 0;
  for (const std::uint32_t row : objects) {
    const Vec3d& position = rows[row].pose.position;
    min = {std::min(min.x, position.x), std::min(min.y, position.y), std::min(min.z, position.z)};
    max = {std::max(max.x, position.x), std::max(max.y, position.y), std::max(max.z, position.z)};
    radius = std::max(radius, shapes[rows[row].shape].bounding_radius);
  }
  const std::size_t samples = std::min(most_samples, objects.size());
  std::array<double, most_samples> x, y, z;
  for (std::size_t i = 0; i < samples; ++i) {
    const Vec3d& position = rows[objects[i * objects.size() / samples]].pose.position;
    x[i] = position.x, y[i] = position.y, z[i] = position.z;
  }
  widen_range(std::span(x).first(samples), min.x, max.x);
  widen_range(std::span(y).first(samples), min.y, max.y);
  widen_range(std::span(z).first(samples), min.z, max.z);
  // Bounds of objects within the range must not be on its surface.
  const double margin = 1.01 * double{radius} + 1;
  return {min - Vec3d{margin, margin, margin}, max + Vec3d{margin, margin, margin}};
}

}  // namespace ringfence::queries
