#pragma once

#include "ringfence/pose.hpp"

namespace ringfence::queries {

/// The pose on the way from `from` to `to`, at `fraction` (0 to 1): the position linear, the orientation linear and
/// then normalised, the shorter way. The same bits on every machine.
Pose interpolate(const Pose& from, const Pose& to, double fraction) noexcept;

/// The cosine of half the angle by which a shape turns on the way between two orientations, 0 to 1.
double turn_cosine(const Quat& from, const Quat& to) noexcept;
/// An upper bound of how far a point of a shape is, anywhere on such a way, from the straight line between its places
/// at both ends, for each metre between the point and the shape's origin.
double most_bulge(double turn_cosine) noexcept;

}  // namespace ringfence::queries
