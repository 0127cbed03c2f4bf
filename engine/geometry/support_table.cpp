#include "geometry/support_table.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>

#include "base/parallel.hpp"

namespace ringfence::geometry {
namespace {

constexpr std::size_t cells = 16;  ///< on each side of a cube face
constexpr std::size_t side = cells + 1;
constexpr std::size_t faces = 6;

/// The coordinate of grid line i, from -1 to 1; exact.
constexpr double coordinate(std::size_t i) { return static_cast<double>(i) * (2.0 / cells) - 1.0; }

/// The direction of a grid point. `face` is 2 * axis for the positive side of the cube and 2 * axis + 1 for the
/// negative.
Vec3d direction_of(std::size_t face, double u, double v) {
  const double along = face % 2 == 0 ? 1.0 : -1.0;
  if (face / 2 == 0) return {along, u, v};
  if (face / 2 == 1) return {v, along, u};
  return {u, v, along};
}

}  // namespace

SupportTable::SupportTable(const MeshTree& tree) : heights_(faces * side * side) {
  base::parallel_for(heights_.size(), 1, [&](std::size_t i) {
    const std::size_t face = i / (side * side), row = i / side % side, column = i % side;
    const double height = tree.support(direction_of(face, coordinate(column), coordinate(row)));
    heights_[i] = std::nextafter(static_cast<float>(height), std::numeric_limits<float>::infinity());
  });
}

double SupportTable::support_bound(Vec3d d) const noexcept {
  const double x = std::abs(d.x), y = std::abs(d.y), z = std::abs(d.z);
  std::size_t face;
  double along, u, v;
  if (x >= y && x >= z) {
    face = d.x >= 0 ? 0 : 1, along = x, u = d.y, v = d.z;
  } else if (y >= z) {
    face = d.y >= 0 ? 2 : 3, along = y, u = d.z, v = d.x;
  } else {
    face = d.z >= 0 ? 4 : 5, along = z, u = d.x, v = d.y;
  }
  const double across = (u / along + 1.0) * (cells / 2.0), up = (v / along + 1.0) * (cells / 2.0);
  const std::size_t column = std::min(static_cast<std::size_t>(across), cells - 1);
  const std::size_t row = std::min(static_cast<std::size_t>(up), cells - 1);
  const double s = across - static_cast<double>(column), t = up - static_cast<double>(row);
  const float* const corner = heights_.data() + (face * side + row) * side + column;
  const double low = double{corner[0]}, far = double{corner[side + 1]};
  // The cell's two triangles share the diagonal from corner 0 to the opposite corner.
  const double mean = s >= t ? low + s * (double{corner[1]} - low) + t * (far - double{corner[1]})
                             : low + t * (double{corner[side]} - low) + s * (far - double{corner[side]});
  return mean * along;
}

}  // namespace ringfence::geometry
