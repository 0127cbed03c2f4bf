#pragma once

#include <span>

#include "geometry/bounds.hpp"
#include "geometry/shape_table.hpp"

namespace ringfence::geometry {

/// Part of the bounding radius by which bounds are wider than what float arithmetic says: 16 float steps, where the
/// rotation matrix can be off by 6 and the sum of products by 3.
inline constexpr double rounding_margin = 0x1p-20;

/// ShapeTable::bounds of those of `placed` that are spheres, boxes, capsules or hulls; what is written for others means
/// nothing. `points`, if not null: FixedSpace::point of each, of whatever shape. `rows` and `hulls` are by shape, null
/// where that is no hull. In lanes, an axis a lane; rounded as FixedSpace does, the same bits at every vector width.
void compute_solid_bounds(std::span<const PlacedShape> placed, const ShapeRow* rows, const Hull* const* hulls,
                          const FixedSpace& space, Bounds* out, FixedPoint* points) noexcept;

}  // namespace ringfence::geometry
