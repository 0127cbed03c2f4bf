#pragma once

#include "reference/vector.hpp"

namespace ringfence::reference {

/// On which side of the plane through `a`, `b`, `c` the point `d` lies: 1 on the side of (b - a) × (c - a), -1 on the
/// other side, 0 in the plane. Exact for all finite coordinates whose magnitude is between about 10^-70 and 10^70.
///
/// A filter in double nearly always decides; otherwise the determinant is summed without rounding (Shewchuk 1997).
int orientation(const Vector& a, const Vector& b, const Vector& c, const Vector& d);

/// The cross product (b - a) × (c - a). Each component is precise to a few units in the last place of the rounded
/// differences, so slivers have a precise normal too (Kahan's difference of products).
Vector triangle_normal(const Vector& a, const Vector& b, const Vector& c);

}  // namespace ringfence::reference
