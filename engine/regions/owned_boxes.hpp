#pragma once

#include "base/numbers.hpp"
#include "geometry/bounds.hpp"
#include "regions/region_map.hpp"

namespace ringfence::regions {

// Boxes that lie within the region of one node. Whether bounds lie in such a box is faster to test than
// RegionMap::coverage(). Both functions read every cell, so they are for changes of the map, not for each frame.

/// Bounds within the region of `node`: a box of whole cells, grown from a cell near the middle of the region. It is
/// the whole region if that is a box of whole cells. Empty (lower above upper) if the node owns no whole cell.
geometry::Bounds interior(const RegionMap& map, NodeNumber node);

/// Bounds within a cut cell and the region of `node`: grown from the part below the most cuts; of several, from the
/// largest. Cells are cut where the weight is, so this is where most of a crowd is. Empty (lower above upper) if the
/// node owns no part of a cut cell.
geometry::Bounds densest_box(const RegionMap& map, NodeNumber node);

}  // namespace ringfence::regions
