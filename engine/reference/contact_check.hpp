#pragma once

#include <string>

#include "reference/shapes.hpp"
#include "ringfence/contact.hpp"
#include "ringfence/pose.hpp"

namespace ringfence::reference {

/// How far an answer may be off. The defaults are those of `--check`.
struct Tolerance {
  double relative = 1e-4;     ///< of the smaller object's bounding radius
  double least = 1e-6;        ///< metres, whatever the sizes
  double of_larger = 0;       ///< of the larger object's bounding radius; 0 asks the same of pairs of any two sizes
  double unit_length = 1e-5;  ///< of the normal, from 1
};

/// The band for a pair, metres: within it of touching either decision is right, and depth, normal and point may be
/// off by as much.
double band(const PreparedShape& a, const PreparedShape& b, const Tolerance& tolerance = {});

/// What is wrong with what the engine says of a pair; empty if nothing is. `claimed` is the contact, or null where
/// there is said to be none.
///
/// Right is: a contact where the shapes overlap by more than the band, none where they are further apart than it; a
/// depth within the band of the least there is; a unit normal along which a translation of b by that depth, and the
/// band, separates the two; a point midway, along the normal, between the farthest of a and the farthest of b, and
/// within half the depth, and the band, of both. To the band for depth, normal and point comes what rounding them to
/// float costs, 2^-22 of the two sizes together: of account where one object is some 1000 times the other. For a mesh,
/// these hold for one of the deepest pairs of primitives.
/// Only depth, normal and point of the contact are looked at.
std::string describe_error(const PreparedShape& a, const Pose& pose_a, const PreparedShape& b, const Pose& pose_b,
                           const Contact* claimed, const Tolerance& tolerance = {});

}  // namespace ringfence::reference
