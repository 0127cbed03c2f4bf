#pragma once

#include "geometry/bounds.hpp"
#include "geometry/shape_table.hpp"
#include "ringfence/pose.hpp"

namespace ringfence::geometry {

/// Part of the bounding radius by which bounds are wider than what float arithmetic says: 16 float steps, where the
/// rotation matrix can be off by 6 and the sum of products by 3.
inline constexpr double rounding_margin = 0x1p-20;

/// ShapeTable::bounds of a sphere, box, capsule or hull; `hull` is that of a hull's row, and not looked at for other
/// kinds. In lanes, an axis a lane; rounded as FixedSpace::bounds does, the same bits at every vector width.
Bounds solid_bounds(const ShapeRow& row, const Hull* hull, const Pose& pose, const FixedSpace& space) noexcept;

}  // namespace ringfence::geometry
