#pragma once

#include <optional>

#include "reference/shapes.hpp"
#include "reference/vector.hpp"

namespace ringfence::reference {

/// The first place, as a fraction from `start` to `end`, where the segment crosses or touches a triangle of a surface;
/// none if there is no such place. A segment in the plane of a triangle does not cross it.
///
/// The decision is exact for the given numbers (see orientation); the fraction is precise to rounding, except where the
/// segment is almost parallel to the triangle. Tries every triangle whose box the segment's box touches.
std::optional<double> first_crossing(const Surface& surface, const Vector& start, const Vector& end);

}  // namespace ringfence::reference
