#pragma once

#include "reference/core_distance.hpp"

namespace ringfence::reference {

/// How far two cores overlap, and along what.
struct CoreOverlap {
  double depth = 0;  ///< least of CorePair::overlap; negative: there is a gap at least that wide
  Vector normal;     ///< unit, from a to b, in the frame of a
  double error = 0;  ///< proven: the true least depth is at most this much less (0: but for rounding)
};

/// The least depth of two polytopes, exact: the least over the face normals of a and of b and over the pairs of edges
/// whose arcs cross on the Gauss map, which together are the faces of the Minkowski difference. Edges along whose arcs
/// a pair of points proves a greater depth than that of the best face are left out. Near misses of two arcs count as
/// crossings, and every depth is taken from all vertices, so rounding cannot make it too small.
CoreOverlap polytope_overlap(const CorePair& pair);

/// The same by every pair of edges, whether or not their arcs cross: slower by the number of vertices.
CoreOverlap exhaustive_overlap(const CorePair& pair);

/// The least depth of any two cores by growing a polytope inside their Minkowski difference until its nearest face and
/// the support plane beyond agree within `tolerance` (van den Bergen 2001), or it grows no more; `error` is what is
/// left between the two. Decisions on what a point sees are exact.
CoreOverlap epa_overlap(const CorePair& pair, double tolerance);

}  // namespace ringfence::reference
