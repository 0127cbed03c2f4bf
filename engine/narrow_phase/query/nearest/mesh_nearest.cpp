#include "narrow_phase/query/nearest/mesh_nearest.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>

#include "geometry/vector.hpp"
#include "narrow_phase/query/mesh_boxes.hpp"
#include "narrow_phase/query/nearest/convex_nearest.hpp"

namespace ringfence::narrow_phase {

bool nearest_in_mesh(const geometry::Mesh& mesh, const Vec3d& point, double limit, Vec3d& nearest, double& distance,
                     std::uint32_t& triangle) {
  // Squared distances. A larger box is not farther, also as computed.
  const auto bound = [&](const CornerBox& box) {
    const Vec3d d{std::max({box.lower.x - point.x, point.x - box.upper.x, 0.0}),
                  std::max({box.lower.y - point.y, point.y - box.upper.y, 0.0}),
                  std::max({box.lower.z - point.z, point.z - box.upper.z, 0.0})};
    return dot(d, d);
  };
  bool found = false;
  double most = limit * limit * (1 + 0x1p-48);
  visit_triangles(
      mesh.tree(), most, bound,
      [&](const std::array<Vec3d, 3>& corners, const geometry::TriangleGroup& leaf, std::size_t lane, double least) {
        const Vec3d place = nearest_in_triangle(point, corners[0], corners[1], corners[2]);
        const double away = std::max(dot(place - point, place - point), least);
        const std::uint32_t number = leaf.index[lane];
        if (away > most || (found && away == most && number > triangle)) return most;
        found = true;
        triangle = number;
        nearest = place;
        return most = away;
      });
  distance = std::sqrt(most);
  return found && distance <= limit;
}

}  // namespace ringfence::narrow_phase
