#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "base/numbers.hpp"
#include "geometry/bounds.hpp"
#include "regions/region_map.hpp"

namespace ringfence::regions {

/// Finds the owners of bounds that follow each other at nearly the same place, as those of a crowd do.
///
/// Keeps the owners of the last bounds that were looked up, and for both corners the range in which each comparison
/// with a face of a cell or a plane of a cut has the same result. Bounds whose corners lie in these ranges have the
/// same owners. Such bounds cost 12 comparisons; others cost more than with RegionMap::visit_owners().
///
/// Threads: one at a time. Memory: four bytes for each owner of the last bounds.
class RecentOwners {
 public:
  /// Forgets everything. Call it after each change of the map.
  void reset() noexcept { owners_.clear(); }

  /// The owners of the space that the bounds cover, each once. Valid until the next call.
  std::span<const NodeNumber> of(const RegionMap& map, const geometry::Bounds& bounds) {
    if (!covers(bounds)) {
      find(map, bounds);
    }
    return owners_;
  }
  /// Whether it is known that these bounds have the owners that of() returned last.
  bool covers(const geometry::Bounds& bounds) const noexcept {
    return !owners_.empty() && geometry::contains(lower_, bounds.lower) && geometry::contains(upper_, bounds.upper);
  }

 private:
  void find(const RegionMap& map, const geometry::Bounds& bounds);
  void add_part(const RegionMap& map, std::uint32_t entry, const geometry::Bounds& bounds);

  std::vector<NodeNumber> owners_;  ///< empty: nothing is known
  geometry::Bounds lower_{};        ///< the range of lower corners with these owners
  geometry::Bounds upper_{};        ///< the range of upper corners
};

}  // namespace ringfence::regions
