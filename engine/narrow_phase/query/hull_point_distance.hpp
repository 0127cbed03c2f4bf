#pragma once

#include "narrow_phase/query/core_distance.hpp"

namespace ringfence::narrow_phase {

/// The distance of a point from a hull, as core_distance() returns it, with less work than its search.
///
/// Returns false if that does not prove the distance to the same tolerance: where the point
/// is in the hull or close to it, and where two features are about equally near; then `out` is not valid. `radius`,
/// metres, of a ball around the point, and `limit` as for core_distance(). Precondition: `hull` is the core of a hull.
///
/// Method: floats choose the face whose plane the point is farthest in front of, and if the point is not above that
/// face, the nearest edge. The nearest point of that feature is exact, and the farthest vertex along the connection
/// proves that no other is nearer. Threads: any. No allocation.
bool hull_point_distance(const ConvexCore& hull, const Vec3d& point, double radius, double limit,
                         CoreDistance& out) noexcept;

}  // namespace ringfence::narrow_phase
