#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "geometry/bounds.hpp"
#include "regions/bisection.hpp"
#include "regions/refinement.hpp"
#include "regions/region_map.hpp"

namespace ringfence::regions {

/// When and how regions follow the load.
struct BalanceConfig {
  std::uint32_t window = 16;    ///< frames over which costs are summed before they are judged
  std::uint32_t rest = 32;      ///< frames between two changes of the map, at least
  double tolerance = 1.06;      ///< busiest node over mean below which nothing is done
  double gain = 0.03;           ///< a new map must promise to take this much off that ratio
  double horizon = 256;         ///< frames within which what a change saves must pay for what it costs
  double retell_ms = 0.0003;    ///< an object told of anew, because the map has changed
  double hand_over_ms = 0.001;  ///< an object whose host changes (M5)
  double grain = 16;            ///< cells heavier than this part of a node's fair share are cut
};

/// Watches what the nodes cost and proposes a map under which they would cost the same.
///
/// What stands and collides in a place weighs there, scaled by what its node was measured to cost for its weight: so
/// whatever makes one region dearer than another (crowding, dear shapes, a slow core) is priced in without being
/// modelled. Cells that are too heavy are cut (Refinement), then all are split (Bisection). Hysteresis: a change must
/// be due, wanted, and worth it: what it takes off the busiest node must within a horizon pay for the objects that are
/// handed over, and for telling every node anew of what is in its region.
///
/// Threads: belongs to the server role. The map that it proposes is a matter of cost alone: contacts do not depend on
/// it. Memory: about 80 bytes a cell, 24 a weight.
class Balance {
 public:
  Balance(const CellGrid& grid, const BalanceConfig& config, std::size_t weights);

  /// One more frame with these costs in milliseconds, one a node.
  void add_frame(std::span<const double> costs);
  /// Whether the costs of the window call for another map; then weigh everything and ask propose().
  bool wanted() const noexcept;
  /// Busiest node over mean in the window; 1 where there is nothing to compare.
  double imbalance() const noexcept;

  void start_weighing();
  /// An object stands there. Objects come before contacts.
  void weigh_object(const std::uint32_t (&point)[3], const geometry::Bounds& bounds);
  /// A contact is there.
  void weigh_contact(const std::uint32_t (&point)[3]);
  /// A better map's table, or empty if none is worth the change. Either way the next proposal is `rest` frames away.
  std::span<const std::uint32_t> propose(const RegionMap& map);
  /// A table for another number of nodes, by the weights; what it costs is not asked.
  std::span<const std::uint32_t> share_out(const RegionMap& map, std::uint32_t nodes);

 private:
  void scale_by_cost(const RegionMap& map);
  std::span<const NodeNumber> split(std::uint32_t nodes);
  bool worth(const RegionMap& map, std::span<const NodeNumber> owners);

  BalanceConfig config_;
  std::vector<double> costs_;  ///< by node, summed over the window so far
  std::uint32_t frames_ = 0;   ///< in the window
  std::uint32_t rested_ = 0;
  std::vector<Weight> weights_;
  std::size_t objects_ = 0;        ///< the first of weights_
  std::uint64_t extents_[3] = {};  ///< of all objects, summed
  std::vector<double> shares_;     ///< by node
  Refinement refinement_;
  Bisection bisection_;
  RegionMap proposed_;
};

}  // namespace ringfence::regions
