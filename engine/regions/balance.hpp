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
  std::uint32_t window = 16;  ///< frames over which costs are summed before they are judged
  std::uint32_t rest = 32;    ///< frames from one weighing to the next, at least
  double tolerance = 1.06;    ///< busiest node over mean below which nothing is done
  double gain = 0.03;         ///< a new map must promise to take this much off that ratio
  double horizon = 256;       ///< frames within which what a change saves must pay for what it costs
  // What a change of the map costs the frames around it: for each object, each that the server tells of anew, and each
  // whose host changes (M5).
  double per_object_ms = 0.00005;
  double resend_ms = 0.0003;
  double hand_over_ms = 0.0005;
  double grain = 16;  ///< cells heavier than this part of a node's fair share are cut
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
  bool needs_new_map() const noexcept;
  /// Busiest node over mean in the window; 1 where there is nothing to compare.
  double imbalance() const noexcept;

  /// Everything that is weighed from here on until the next call counts for the next map, against the costs as they are
  /// now. The next is wanted `rest` frames later at the soonest. What happens to the map meanwhile does not matter, but
  /// a map should be there within a window: the one after it is judged by costs that it had no part in otherwise.
  void begin_weights();
  /// An object stands there. Objects come before contacts.
  void add_object_weight(const std::uint32_t (&point)[3]) { weigh(point, weight_of_object), ++objects_; }
  /// An object has such bounds, or had some time ago: how large they are on average limits how finely cells are cut.
  void add_object_size(const geometry::Bounds& bounds);
  /// A contact is there.
  void add_contact_weight(const std::uint32_t (&point)[3]) { weigh(point, weight_of_contact); }
  /// Everything has been weighed: cuts the cells that are too heavy for so many nodes. `map`: under which the costs
  /// were.
  void refine(const RegionMap& map, std::uint32_t nodes);
  /// After refine(), for as many nodes as `map` has: a better map's table, or empty if none is worth the change, after
  /// which the server would have to tell of so many objects anew. Holds until the next refine().
  std::span<const std::uint32_t> propose(const RegionMap& map, std::size_t retold);
  /// After refine(): a table for that number of nodes, whatever the change costs.
  std::span<const std::uint32_t> partition_for(std::uint32_t nodes);

 private:
  // What a present object costs to move and sweep is about what half a contact costs to find.
  static constexpr float weight_of_object = 1;
  static constexpr float weight_of_contact = 2;

  void weigh(const std::uint32_t (&point)[3], float weight) {
    weights_.push_back({{point[0], point[1], point[2]}, weight});
  }
  void scale_by_cost(const RegionMap& map);
  bool is_worthwhile(const RegionMap& map, std::span<const NodeNumber> owners, std::size_t retold);

  BalanceConfig config_;
  std::vector<double> costs_;   ///< by node, summed over the window so far
  std::vector<double> judged_;  ///< the same when weighing was started
  std::uint32_t frames_ = 0;    ///< in the window
  std::uint32_t rested_ = 0;
  std::vector<Weight> weights_;
  std::vector<NodeNumber> owners_;  ///< of each
  std::size_t objects_ = 0;         ///< the first of weights_
  std::size_t sized_ = 0;           ///< objects whose
  std::uint64_t extents_[3] = {};   ///< are summed here
  std::vector<double> shares_;      ///< by node
  Refinement refinement_;
  Bisection bisection_;
  RegionMap proposed_;
};

}  // namespace ringfence::regions
