#include "narrow_phase/hull/polytope.hpp"

#include <algorithm>
#include <cmath>
#include <vector>

namespace ringfence::narrow_phase {
namespace {

/// A box with half extents of 1. Its normals and edge directions are exactly the axes.
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

BoxPolytope::BoxPolytope(const float size[3]) noexcept {
  static const Polytope unit = polytope_of(unit_box());
  polytope_ = unit;
  for (std::size_t i = 0; i < geometry::hull_lanes; ++i) {
    for (std::size_t axis = 0; axis < 3; ++axis) vertex_[axis][i] = unit.vertex[axis][i] * size[axis];
    offset_[i] = (std::abs(unit.normal[0][i]) * size[0] + std::abs(unit.normal[1][i]) * size[1]) +
                 std::abs(unit.normal[2][i]) * size[2];
  }
  for (std::size_t axis = 0; axis < 3; ++axis) polytope_.vertex[axis] = vertex_[axis];
  polytope_.offset = offset_;
  polytope_.edge_columns = nullptr;
  polytope_.centre = {};
  polytope_.inner_radius = std::min({size[0], size[1], size[2]});
  polytope_.outer_radius = std::sqrt((size[0] * size[0] + size[1] * size[1]) + size[2] * size[2]);
}

}  // namespace ringfence::narrow_phase
