#pragma once

#include "reference/core_distance.hpp"

namespace ringfence::reference {

/// How far two cores overlap, and in which direction.
struct CoreOverlap {
  double depth = 0;  ///< the least value of CorePair::overlap; negative: there is a gap at least that wide
  Vector normal;     ///< unit, from a to b, in the frame of a
  double error = 0;  ///< proven bound: the true least depth is smaller by at most this (0: except for rounding)
};

/// The exact least depth of two polytopes: the minimum over the face normals of a and of b and over the pairs of edges
/// whose arcs cross on the Gauss map. Together these are the faces of the Minkowski difference. Edges for whose whole
/// arc a pair of points proves a greater depth than the best face has are skipped. Near misses of two arcs count as
/// crossings, and every depth is computed from all vertices, so rounding cannot make it too small.
CoreOverlap polytope_overlap(const CorePair& pair);

/// The same over all pairs of edges, whether or not their arcs cross. Slower by a factor of the number of vertices.
CoreOverlap exhaustive_overlap(const CorePair& pair);

/// The least depth of any two cores by the expanding polytope algorithm (EPA): grows a polytope inside their Minkowski
/// difference until its nearest face and the support plane beyond it agree within `tolerance`, or it cannot grow any
/// more (van den Bergen 2001). `error` is the remaining difference. The decisions which faces a point sees are exact.
CoreOverlap epa_overlap(const CorePair& pair, double tolerance);

}  // namespace ringfence::reference
