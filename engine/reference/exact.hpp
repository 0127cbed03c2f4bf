#pragma once

#include "reference/vector.hpp"

namespace ringfence::reference {

/// On which side of the plane through `a`, `b`, `c` the point `d` lies: 1 where (b - a) × (c - a) points, -1 behind,
/// 0 in the plane. Exact for all finite coordinates between about 10^-70 and 10^70 in size.
///
/// A filter in double decides nearly always; else the determinant is summed without rounding (Shewchuk 1997).
int orientation(const Vector& a, const Vector& b, const Vector& c, const Vector& d);

/// The cross product (b - a) × (c - a), each component right to a few units in the last place of the rounded
/// differences: slivers have the right normal too (Kahan's difference of products).
Vector triangle_normal(const Vector& a, const Vector& b, const Vector& c);

}  // namespace ringfence::reference
