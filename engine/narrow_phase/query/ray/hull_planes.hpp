#pragma once

#include <cstdint>

#include "geometry/hull.hpp"
#include "narrow_phase/query/ray/local_ray.hpp"

namespace ringfence::narrow_phase {

/// A ray and the planes of a hull's faces.
struct PlaneClip {
  double enter = 0;           ///< the place behind which the line is behind all planes that it crosses inwards
  double leave = 0;           ///< the place up to which it is behind all others; minus infinity if it never is
  std::uint32_t entered = 0;  ///< the face that determines `enter`
  double farthest = 0;        ///< the largest distance of the origin from a plane; negative behind all
};

/// Clips the line of a ray by the planes of all faces, moved outwards by `margin` metres. Vectorised; the same bits at
/// every width.
PlaneClip clip_by_planes(const geometry::Hull& hull, const LocalRay& ray, double margin);

}  // namespace ringfence::narrow_phase
