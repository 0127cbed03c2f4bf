#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "regions/bisection.hpp"
#include "regions/region_map.hpp"

namespace ringfence::regions {

/// When and how regions follow the load.
struct BalanceConfig {
  std::uint32_t window = 16;  ///< frames over which costs are summed before they are judged
  std::uint32_t rest = 32;    ///< frames between two changes of the map, at least
  double tolerance = 1.08;    ///< busiest node over mean below which nothing is done
  double gain = 0.04;         ///< a new map must promise to take this much off that ratio
};

/// Watches what the nodes cost and proposes a map under which they would cost the same.
///
/// A cell's weight is what stands and collides in it, scaled by what its node was measured to cost for its weight: so
/// whatever makes one region dearer than another (crowding, dear shapes, a slow core) is priced in without being
/// modelled. Hysteresis: a change must be due, wanted and worth it.
///
/// Threads: belongs to the server role. The map that it proposes is a matter of cost alone: contacts do not depend on
/// it. Memory: 16 bytes a cell.
class Balance {
 public:
  Balance(const CellGrid& grid, const BalanceConfig& config);

  /// One more frame with these costs, one a node, in any unit.
  void add_frame(std::span<const double> costs);
  /// Whether the costs of the window call for another map; then weigh() every object and contact and ask propose().
  bool wanted() const noexcept;
  /// Busiest node over mean in the window; 1 where there is nothing to compare.
  double imbalance() const noexcept;

  void start_weighing();
  /// Something of that relative cost stands in the cell.
  void weigh(std::uint32_t cell, double cost) noexcept { weights_[cell] += cost; }
  /// A better map's owners, or empty if none is worth the change. Either way the next proposal is `rest` frames away.
  std::span<const NodeNumber> propose(const RegionMap& map);
  /// Owners for another number of nodes, by the weights.
  std::span<const NodeNumber> share_out(const RegionMap& map, std::uint32_t nodes);

 private:
  void scale_by_cost(const RegionMap& map);

  BalanceConfig config_;
  std::vector<double> costs_;  ///< by node, summed over the window so far
  std::uint32_t frames_ = 0;   ///< in the window
  std::uint32_t rested_ = 0;
  std::vector<double> weights_;  ///< by cell
  std::vector<double> shares_;   ///< by node
  Bisection bisection_;
};

}  // namespace ringfence::regions
