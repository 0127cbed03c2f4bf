#include "narrow_phase/query/ray/mesh_ray.hpp"

#include <algorithm>
#include <array>
#include <cstddef>
#include <limits>

#include "narrow_phase/query/mesh_boxes.hpp"
#include "narrow_phase/query/ray/line_box.hpp"
#include "narrow_phase/query/ray/triangle_ray.hpp"

namespace ringfence::narrow_phase {

bool cast_at_mesh(const LocalRay& ray, const geometry::Mesh& mesh, double most, LocalHit& hit,
                  std::uint32_t& triangle) {
  constexpr double none = std::numeric_limits<double>::infinity();
  const double margin = 4 * ray.slack, begin = ray.begin - ray.slack;
  const LineInBox line(ray.foot, ray.direction, {margin, margin, margin});
  const auto bound = [&](const CornerBox& box) {
    const double enter = line.enter(box, begin);
    return enter < none ? std::max(enter, ray.begin) : none;
  };
  bool found = false;
  most = std::min(most, ray.end + ray.slack);
  visit_triangles(
      mesh.tree(), most, bound,
      [&](const std::array<Vec3d, 3>& corners, const geometry::TriangleGroup& leaf, std::size_t lane, double least) {
        TriangleCrossing crossing;
        if (!cross_triangle(ray.foot, ray.direction, corners[0], corners[1], corners[2], crossing) ||
            crossing.place < begin) {
          return most;
        }
        const double place = std::max(crossing.place, least);
        const std::uint32_t number = leaf.index[lane];
        if (place > most || (found && place == most && number > triangle)) return most;
        found = true;
        triangle = number;
        const Vec3d normal{double{leaf.normal[0][lane]}, double{leaf.normal[1][lane]}, double{leaf.normal[2][lane]}};
        hit.place = place;
        hit.normal = normal * ((crossing.front ? 1 : -1) / length(normal));
        return most = place;
      });
  return found;
}

}  // namespace ringfence::narrow_phase
