#pragma once

#include "reference/core.hpp"
#include "reference/vector.hpp"

namespace ringfence::reference {

/// Two cores, the second placed in the frame of the first. Radii are no concern of what takes this.
struct CorePair {
  const Core& a;
  const Core& b;
  Placement b_in_a;

  /// The least translation of b along the unit vector `n` after which n · x on b is nowhere less than on a; negative
  /// where there is a gap. Its least value over all directions is the depth, its negative there the distance.
  double overlap(const Vector& n) const {
    return a.extent(n) + b.extent(b_in_a.rotation.inverse(-n)) - dot(n, b_in_a.offset);
  }
  /// How far two points of the cores may lie from each other's origins: what rounding errors are relative to.
  double scale() const { return a.reach + b.reach; }
};

/// Bounds on the distance between two cores.
struct CoreDistance {
  double lower = 0;  ///< proven by a separating plane; 0 if none is known
  double upper = 0;  ///< proven by two points
  Vector on_a;       ///< the two points, in the frame of a
  Vector on_b;
  bool converged = false;  ///< upper - lower is within the rounding error, or the cores overlap (upper and lower are 0)
};

/// By the algorithm of Gilbert, Johnson and Keerthi (1988), with the closest point of a simplex found among all its
/// faces. Ends when the bounds meet within `tolerance` (metres) or progress does; `settled` says which.
CoreDistance gjk_distance(const CorePair& pair, double tolerance);

/// By trying every vertex with every triangle and every edge with every edge. Precondition: both are polytopes and do
/// not overlap (else the distance between their surfaces comes out). Always settled.
CoreDistance exhaustive_distance(const CorePair& pair);

}  // namespace ringfence::reference
