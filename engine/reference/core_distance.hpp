#pragma once

#include "reference/core.hpp"
#include "reference/vector.hpp"

namespace ringfence::reference {

/// Two cores, the second placed in the frame of the first. Functions that take a CorePair ignore the radii.
struct CorePair {
  const Core& a;
  const Core& b;
  Placement b_in_a;

  /// The least translation of b along the unit vector `n` after which n · x on b is at least n · x on a; negative where
  /// there is a gap. Its minimum over all directions is the depth, or minus the distance if there is a gap.
  double overlap(const Vector& n) const {
    return a.extent(n) + b.extent(b_in_a.rotation.inverse(-n)) - dot(n, b_in_a.offset);
  }
  /// An upper bound of the coordinates involved, to which rounding errors are relative, metres.
  double scale() const { return a.reach + b.reach; }
};

/// Bounds on the distance between two cores.
struct CoreDistance {
  double lower = 0;  ///< proven by a separating plane; 0 if none is known
  double upper = 0;  ///< proven by two points
  Vector on_a;       ///< these two points, in the frame of a
  Vector on_b;
  bool converged = false;  ///< upper - lower is within the rounding error, or the cores overlap (upper and lower are 0)
};

/// Computes the distance by the algorithm of Gilbert, Johnson and Keerthi (1988); the closest point of a simplex is
/// found among all its faces. Ends when the bounds differ by at most `tolerance` (metres), or when there is no more
/// progress; `converged` says which.
CoreDistance gjk_distance(const CorePair& pair, double tolerance);

/// Computes the distance by trying every vertex with every triangle and every edge with every edge. Precondition: both
/// are polytopes and do not overlap (else the result is the distance between their surfaces). Always converged.
CoreDistance exhaustive_distance(const CorePair& pair);

}  // namespace ringfence::reference
