#pragma once

#include <span>

#include "geometry/bounds.hpp"
#include "geometry/shape_table.hpp"

namespace ringfence::geometry {

/// Bounds are widened by this part of the bounding radius: 16 float steps. The rotation matrix can be wrong by 6 steps
/// and the sum of products by 3.
inline constexpr double rounding_margin = 0x1p-20;

/// Computes ShapeTable::bounds of the placed spheres, boxes, capsules and hulls; `out` is unspecified for other shapes.
/// If `points` is not null, computes FixedSpace::point for every placed shape. `rows` and `hulls` are indexed by shape
/// number; `hulls` is null for other shapes. Vectorised over the shapes; rounds as FixedSpace does, with the same bits
/// at every vector width.
void compute_solid_bounds(std::span<const PlacedShape> placed, const ShapeRow* rows, const Hull* const* hulls,
                          const FixedSpace& space, Bounds* out, FixedPoint* points) noexcept;

}  // namespace ringfence::geometry
