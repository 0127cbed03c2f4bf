#pragma once

#include "geometry/vector.hpp"

namespace ringfence::narrow_phase {

/// Where a line crosses a triangle.
struct TriangleCrossing {
  double place = 0;    ///< metres from `foot` along `direction`
  bool front = false;  ///< whether the line comes from the side from which the corners appear anticlockwise
};

/// Finds where the line through `foot` along the unit vector `direction` crosses the triangle a, b, c. Returns whether
/// it does. A line in the plane of the triangle does not.
///
/// No line that crosses the triangle or its boundary is missed, as computed with the given numbers; so a line cannot
/// pass between two triangles that share an edge. A line within rounding, about 10^-15 of the lengths involved, of the
/// boundary may count as crossing. The place is precise to 2^-24 of the triangle's size for grazing lines and to
/// rounding for others. Method: Moeller and Trumbore (1997), with a bound of the rounding error for each edge; lines
/// that are almost in the plane are computed again in twice the precision.
bool cross_triangle(const Vec3d& foot, const Vec3d& direction, const Vec3d& a, const Vec3d& b, const Vec3d& c,
                    TriangleCrossing& out) noexcept;

}  // namespace ringfence::narrow_phase
