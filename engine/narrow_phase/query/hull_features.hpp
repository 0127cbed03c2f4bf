#pragma once

#include <cstdint>

#include "geometry/hull.hpp"
#include "geometry/vector.hpp"

namespace ringfence::narrow_phase {

// Searches through all features of a hull, on its axes. Vectorised; the same bits at every width. Of features with the
// same value, the lowest counts.

/// The vertex that is farthest along a direction, in double.
std::uint32_t farthest_vertex(const geometry::Hull& hull, const Vec3d& direction) noexcept;

/// The largest distance of a point from the plane of a face, in double; negative behind all planes. Metres.
double farthest_plane(const geometry::Hull& hull, const Vec3d& point) noexcept;

/// The face whose plane a point is farthest in front of, in float.
struct HighestFace {
  std::uint32_t face = 0;
  float height = 0;  ///< metres in front of the plane; negative behind all
};
HighestFace highest_face(const geometry::Hull& hull, const Vec3f& point) noexcept;

/// The edge that is nearest to a point, in float.
std::uint32_t nearest_edge(const geometry::Hull& hull, const Vec3f& point) noexcept;

}  // namespace ringfence::narrow_phase
