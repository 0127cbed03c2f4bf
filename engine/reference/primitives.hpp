#pragma once

#include <functional>

#include "reference/shapes.hpp"

namespace ringfence::reference {

/// Calls `visit(p, q)` for the pairs of primitives of two shapes whose boxes come within `reach` (metres) of each
/// other. `p` is in the frame of a, `q` in that of b, which `b_in_a` places. A convex shape is its only primitive; the
/// primitives of a mesh are its triangles.
///
/// `visit` returns the least depth (metres; negative: minus the largest distance) that is of interest from now on.
/// Pairs whose boxes exclude that depth are skipped. The cores are valid during the call only.
void for_each_primitive_pair(const PreparedShape& a, const PreparedShape& b, const Placement& b_in_a, double reach,
                             const std::function<double(const Core& p, const Core& q)>& visit);

}  // namespace ringfence::reference
