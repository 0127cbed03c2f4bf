#pragma once

#include <limits>

#include "reference/shapes.hpp"
#include "ringfence/pose.hpp"

namespace ringfence::reference {

/// The distance of two shapes, or the depth of their overlap.
struct Separation {
  /// Metres. Positive: the distance. Negative: minus the depth, the least translation of b in any direction that
  /// separates the shapes. Zero: they touch. For a mesh, the least value over pairs of primitives: a mesh is a surface.
  double distance = 0;
  Vec3d normal;      ///< unit, world axes, from a to b: along the shortest connection, or along the least translation
  double error = 0;  ///< the true distance differs from `distance` by at most this
};

/// The separation of two placed shapes in double precision, by exhaustive methods.
///
/// Exact (to about 10^-12 of the two sizes together) for all kinds except support functions, which return floats: for
/// them `error` is the remaining uncertainty, about 10^-6 of the size, rarely 10^-4. Far from the origin it is as
/// precise as the difference of the positions.
///
/// `reach`, metres, concerns meshes: pairs of primitives farther apart than that are skipped. If all are, the distance
/// is `reach`, which is then a lower bound, and the normal is zero.
///
/// Orientations need not be exactly unit; positions must be finite. Threads: any. Cost: 0.1 to 2 µs for a pair of
/// spheres, capsules or boxes, 7 µs for hulls of 32 points, 0.2 ms for hulls of 128 points; for a mesh it depends on
/// the number of triangles near the other shape.
Separation separation(const PreparedShape& a, const Pose& pose_a, const PreparedShape& b, const Pose& pose_b,
                      double reach = std::numeric_limits<double>::infinity());

/// The separation of two rounded cores, the second placed in the frame of the first; the normal is in that frame.
Separation separation(const Core& a, const Core& b, const Placement& b_in_a);

}  // namespace ringfence::reference
