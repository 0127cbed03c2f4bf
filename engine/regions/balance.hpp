#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "base/numbers.hpp"
#include "geometry/bounds.hpp"
#include "regions/bisection.hpp"
#include "regions/refinement.hpp"
#include "regions/region_map.hpp"

namespace ringfence::regions {

/// Parameters of load balancing.
struct BalanceConfig {
  std::uint32_t window = 16;        ///< frames whose costs are summed before they are compared
  std::uint32_t min_interval = 32;  ///< minimum number of frames from one begin_weights() to the next
  double tolerance = 1.06;          ///< imbalance (cost of the busiest node over the mean) up to which the map is kept
  double gain = 0.03;               ///< minimum reduction of the imbalance by a new map, as computed from the weights
  double horizon = 256;  ///< number of frames within which a new map must save more time than the change costs
  // Costs of a change of the map, in ms: for each object, for each object that the server sends to nodes again, and for
  // each object whose host changes (M5).
  double per_object_ms = 0.00005;
  double resend_ms = 0.0003;
  double hand_over_ms = 0.0005;
  double grain = 16;  ///< cells heavier than 1/grain of the mean weight of a node are cut
};

/// Cost of one node in one frame.
struct NodeCost {
  NodeNumber node = 0;  ///< an owner in the region map
  double ms = 0;
};

/// Measures the cost of each node and proposes a map with equal costs.
///
/// Each object and each contact has a weight at its position. The weights in a region are multiplied by the measured
/// cost of its node per unit of weight. So everything that makes one region more expensive (crowding, complex shapes, a
/// slow core) is included without a model of it. Cells that are too heavy are cut (Refinement), then the parts are
/// divided among the nodes (Bisection).
///
/// Hysteresis: a new map is proposed only if the minimum interval has passed, the imbalance exceeds the tolerance, and
/// the change pays off: its savings on the busiest node within the horizon must exceed the cost of the hand-overs and
/// of sending all nodes the contents of their regions again.
///
/// Threads: one at a time, but add_frame() may be called while another thread is in refine() or propose(). The map
/// affects cost only, never contacts. Memory: about 80 bytes a cell, 24 a weight.
class Balance {
 public:
  /// Reserves memory for `weights` weights. More may be added, at the cost of an allocation.
  Balance(const CellGrid& grid, const BalanceConfig& config, std::size_t weights);

  /// Adds the costs of one frame, of all nodes, by ascending node. Other nodes than before start a new window.
  void add_frame(std::span<const NodeCost> costs);
  /// Forgets the costs of the window so far, which were measured under another map.
  void begin_window() noexcept { frames_ = 0, costs_.clear(); }
  /// Whether the window is complete, the minimum interval has passed and the imbalance exceeds the tolerance. Then call
  /// begin_weights(), add all weights, and call refine() and propose().
  bool needs_new_map() const noexcept;
  /// Cost of the busiest node over the mean, in the window; 1 if the costs are unknown.
  double imbalance() const noexcept;

  /// Starts a new set of weights and saves the current costs as their reference. needs_new_map() returns false for the
  /// next `min_interval` frames. The map may change before propose().
  void begin_weights();
  /// Adds the weight of an object at a fixed-point position. All objects come before the contacts.
  void add_object_weight(const std::uint32_t (&point)[3]) { weigh(point, weight_of_object), ++objects_; }
  /// Adds the size of an object, from its bounds in this or a recent frame. The average size limits how finely cells
  /// are cut.
  void add_object_size(const geometry::Bounds& bounds);
  /// Adds the weight of a contact at a fixed-point position.
  void add_contact_weight(const std::uint32_t (&point)[3]) { weigh(point, weight_of_contact); }
  /// Cuts the cells that are too heavy for `nodes` nodes. Call it after all weights are added. `map` is the map under
  /// which the reference costs were measured.
  void refine(const RegionMap& map, std::uint32_t nodes);
  /// After refine(): the table of a better map for `nodes` (ascending), or empty if no change pays off. `resent` is the
  /// number of objects that the server would send again. Valid until the next propose().
  std::span<const std::uint32_t> propose(const RegionMap& map, std::span<const NodeNumber> nodes, std::size_t resent);
  /// After refine(): a table for `nodes` (ascending; 1 to the number of cells), whatever the cost of the change. Valid
  /// until the next refine(), propose() or partition_for().
  std::span<const std::uint32_t> partition_for(std::span<const NodeNumber> nodes);

 private:
  // Moving and sweeping an object costs about half as much as finding a contact.
  static constexpr float weight_of_object = 1;
  static constexpr float weight_of_contact = 2;

  void weigh(const std::uint32_t (&point)[3], float weight) {
    weights_.push_back({{point[0], point[1], point[2]}, weight});
  }
  void scale_by_cost(const RegionMap& map);
  void split(std::span<const NodeNumber> nodes);
  bool pays_off(const RegionMap& map, std::size_t nodes, std::size_t resent);

  BalanceConfig config_;
  std::vector<NodeCost> costs_;            ///< summed over the window so far
  std::vector<NodeCost> reference_costs_;  ///< costs_ at the last begin_weights()
  std::uint32_t frames_ = 0;               ///< frames in the window so far
  std::uint32_t frames_since_weights_ = 0;
  std::vector<Weight> weights_;
  std::vector<NodeNumber> owners_;       ///< node of each weight
  std::size_t objects_ = 0;              ///< number of objects in weights_; they come first
  std::size_t sized_objects_ = 0;        ///< number of objects in extents_
  std::uint64_t extents_[3] = {};        ///< sum of their sizes on each axis, fixed-point steps
  std::vector<double> node_weights_;     ///< by node; scratch
  std::vector<double> scales_;           ///< by node: measured cost per weight; scratch
  std::vector<NodeNumber> leaf_owners_;  ///< result of split()
  Refinement refinement_;
  Bisection bisection_;
  RegionMap proposed_;
};

}  // namespace ringfence::regions
