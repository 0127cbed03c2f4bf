#pragma once

#include <limits>

#include "reference/shapes.hpp"
#include "ringfence/pose.hpp"

namespace ringfence::reference {

/// How far apart two shapes are, or how far they overlap.
struct Separation {
  /// Metres. Above zero: the distance. Below: minus the least depth, over all directions, of a translation of b that
  /// separates the two. Zero: they touch. For a mesh, the least over pairs of primitives: a mesh is a surface.
  double distance = 0;
  Vec3d normal;      ///< unit, world axes, from a to b: along the shortest connection, or the least translation
  double error = 0;  ///< the true distance lies within this much of `distance`
};

/// The separation of two placed shapes, in double precision, by methods that try everything there is.
///
/// Exact (to some 10^-12 of the two sizes together) for all kinds but support functions, which are known in float:
/// there `error` says what is left, some 10^-6 of the size, seldom 10^-4. Far from the origin it is as right as the
/// difference of the positions is.
///
/// `reach`, metres, concerns meshes: pairs of primitives further apart than that are left out, and if all are, the
/// distance is `reach` and a lower bound; the normal is then zero.
///
/// Orientations need not be exactly unit; positions must be finite. Threads: any. Cost: 0.1 to 2 µs
/// a pair of spheres, capsules and boxes, 7 µs of hulls of 32 points, 0.2 ms of hulls of 128; a mesh as much as its
/// triangles near the other.
Separation separation(const PreparedShape& a, const Pose& pose_a, const PreparedShape& b, const Pose& pose_b,
                      double reach = std::numeric_limits<double>::infinity());

/// The separation of two rounded cores, the second placed in the frame of the first; the normal is in that frame.
Separation separation(const Core& a, const Core& b, const Placement& b_in_a);

}  // namespace ringfence::reference
