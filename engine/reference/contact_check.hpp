#pragma once

#include <string>
#include <utility>

#include "reference/shapes.hpp"
#include "ringfence/contact.hpp"
#include "ringfence/pose.hpp"

namespace ringfence::reference {

/// How far a reported contact may differ from the exact one. The defaults are those of `--check`.
struct Tolerance {
  double relative = 1e-4;  ///< of the smaller object's bounding radius
  double least = 1e-6;     ///< metres, for all sizes
  double of_larger = 0;    ///< of the larger object's bounding radius; 0: the same tolerance for pairs of any two sizes
  double unit_length = 1e-5;  ///< of the length of the normal
};

/// The tolerance band of a pair, metres. If the distance or depth is within it, both decisions (contact, no contact)
/// are right; depth, normal and point may differ by as much.
double band(const PreparedShape& a, const PreparedShape& b, const Tolerance& tolerance = {});

/// Describes what is wrong with the engine's result for a pair; empty if it is right. `claimed` is the reported
/// contact, or null if the engine reports none.
///
/// A result is right under these conditions:
/// - there is a contact if the shapes overlap by more than the band, and none if their distance is larger than it;
/// - the depth differs from the least depth by at most the band;
/// - the normal is a unit vector, and a translation of b along it by the depth plus the band separates the shapes;
/// - the point lies midway, along the normal, between the farthest point of a and the farthest point of b, and its
///   distance from each shape is at most half the depth plus the band.
/// For depth, normal and point the band is widened by the cost of rounding to float, 2^-22 of the two sizes together.
/// It matters where one object is about 1000 times larger than the other. For a mesh the conditions have to hold for
/// one of the deepest pairs of primitives. For the point it is also widened by the rounding of its coordinates to
/// double, 2^-53 of their length: 0.1 m at 10^15 m. Only depth, normal and point of the contact are checked.
std::string describe_error(const PreparedShape& a, const Pose& pose_a, const PreparedShape& b, const Pose& pose_b,
                           const Contact* claimed, const Tolerance& tolerance = {});

/// The bounds of the depth that the engine may report for a pair, metres, `least` first; negative: minus the distance.
std::pair<double, double> depth_bounds(const PreparedShape& a, const Pose& pose_a, const PreparedShape& b,
                                       const Pose& pose_b, const Tolerance& tolerance = {});

}  // namespace ringfence::reference
