#pragma once

#include <string>

#include "reference/shapes.hpp"
#include "ringfence/pose.hpp"

namespace ringfence::reference {

/// A convex shape that moves by `displacement` from `start`, with a fixed orientation; metres, world axes. A ray is the
/// motion of point_shape().
struct Motion {
  const PreparedShape& shape;  ///< no mesh
  Pose start;
  Vec3d displacement;
};

/// A ball of radius 0.
const PreparedShape& point_shape();

/// A reported first contact of a motion with a shape, as in ShapeHit.
struct ClaimedHit {
  double fraction = 0;
  Vec3d normal, point;
};

/// A reported nearest point.
struct ClaimedPoint {
  double distance = 0;
  Vec3d point;
};

// The following functions describe what is wrong with the answer to a query against one shape; empty if it is right.
// `allowed` is the tolerance in metres. A null claim says that there is no hit. All are independent of the engine: they
// rely on the separation of two shapes and on exact predicates, and search by bisection. Exact except for support
// functions; see separation(). Positions are subtracted first. Threads: any. Cost: about 40 separations for each convex
// shape or triangle that the motion comes near to.

/// A claim is right under these conditions:
/// - before its fraction (no hit: on the whole way) the shapes nowhere overlap by more than `allowed`; for a ray and a
///   mesh: of the ray and of eight others around it, displaced sideways by `allowed`, one at least crosses nothing
///   before the fraction, less `allowed`;
/// - at its fraction they are at most `allowed` apart;
/// - unless it starts inside, the plane with its normal separates the shapes there, but for `allowed`; the normal is a
///   unit vector against the motion; the point is at most `allowed` from both shapes;
/// - where it starts inside, fraction, normal and point are those of the contract of ShapeHit.
std::string describe_hit_error(const PreparedShape& shape, const Pose& pose, const Motion& motion,
                               const ClaimedHit* claimed, double allowed);

/// A claim is right if the shapes overlap, or are apart, by at most `allowed` otherwise.
std::string describe_overlap_error(const PreparedShape& shape, const Pose& pose, const PreparedShape& other,
                                   const Pose& other_pose, bool claimed, double allowed);

/// A claim is right if its distance is that of the shape, its point lies on the shape and has that distance, and it is
/// within `limit`; all but for `allowed`.
std::string describe_nearest_error(const PreparedShape& shape, const Pose& pose, const Vec3d& point, double limit,
                                   const ClaimedPoint* claimed, double allowed);

}  // namespace ringfence::reference
