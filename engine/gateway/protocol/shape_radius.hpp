#pragma once

#include "ringfence/shape.hpp"

namespace ringfence::gateway {

/// Radius of a ball around the origin of the shape that contains it, metres; not always the smallest.
double shape_radius(const ShapeDescription& shape);

}  // namespace ringfence::gateway
