#include "narrow_phase/convex_polytope.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <vector>

namespace ringfence::narrow_phase {
namespace {

using geometry::EdgeColumn;

/// Half extents of 1: its normals and edge directions are exactly those of the axes.
const geometry::Hull& unit_box() {
  static const geometry::Hull hull = [] {
    std::vector<Vec3f> corners;
    for (int i = 0; i < 8; ++i) {
      corners.push_back({(i & 1) != 0 ? 1.0f : -1.0f, (i & 2) != 0 ? 1.0f : -1.0f, (i & 4) != 0 ? 1.0f : -1.0f});
    }
    return geometry::build_hull(corners);
  }();
  return hull;
}

}  // namespace

Polytope polytope_of(const geometry::Hull& hull) noexcept {
  Polytope p{{hull.x(), hull.y(), hull.z()},
             {hull.normal_x(), hull.normal_y(), hull.normal_z()},
             hull.offset(),
             {},
             hull.edges().data(),
             hull.vertex_count(),
             hull.face_count(),
             hull.edge_count(),
             hull.centroid(),
             hull.inner_radius(),
             hull.bounding_radius()};
  for (std::size_t c = 0; c < geometry::edge_columns; ++c) p.edge[c] = hull.edge_column(static_cast<EdgeColumn>(c));
  return p;
}

BoxPolytope::BoxPolytope(const float size[3]) noexcept : polytope_(polytope_of(unit_box())) {
  const Polytope unit = polytope_;
  std::fill(std::begin(offset_), std::end(offset_), 0.0f);
  std::fill(std::begin(length_), std::end(length_), 0.0f);
  for (std::size_t axis = 0; axis < 3; ++axis) {
    const float half = size[axis];
    const float* from = unit.edge[static_cast<std::size_t>(EdgeColumn::from_x) + axis];
    const float* along = unit.edge[static_cast<std::size_t>(EdgeColumn::along_x) + axis];
    for (std::size_t i = 0; i < geometry::hull_lanes; ++i) {
      vertex_[axis][i] = unit.vertex[axis][i] * half;
      from_[axis][i] = from[i] * half;
      offset_[i] += std::abs(unit.normal[axis][i]) * half;
      length_[i] += std::abs(along[i]) * (2 * half);
    }
    polytope_.vertex[axis] = vertex_[axis];
    polytope_.edge[static_cast<std::size_t>(EdgeColumn::from_x) + axis] = from_[axis];
  }
  polytope_.offset = offset_;
  polytope_.edge[static_cast<std::size_t>(EdgeColumn::length)] = length_;
  polytope_.centre = {};
  polytope_.inner_radius = std::min({size[0], size[1], size[2]});
  polytope_.outer_radius = std::sqrt((size[0] * size[0] + size[1] * size[1]) + size[2] * size[2]);
}

}  // namespace ringfence::narrow_phase
