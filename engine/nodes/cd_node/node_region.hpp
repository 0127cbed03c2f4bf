#pragma once

#include <cstdint>
#include <utility>
#include <vector>

#include "base/numbers.hpp"
#include "geometry/bounds.hpp"
#include "messages/header.hpp"
#include "regions/region_map.hpp"
#include "ringfence/pose.hpp"

namespace ringfence::nodes {

/// The region of a CD node: the map of all regions, the node's slot in it, and a new map while it arrives.
///
/// Threads: belongs to its CD node. Memory: two tables of the map; grows to the largest one.
class NodeRegion {
 public:
  /// `space` outlives the region. `slots`: number of slots of nodes.
  NodeRegion(const regions::RegionMap& map, const geometry::FixedSpace& space, NodeNumber node, std::uint32_t slots);

  /// Sets the node's slot and the number of slots. Between frames.
  void assign(NodeNumber node, std::uint32_t slots);

  const regions::RegionMap& map() const noexcept { return map_; }
  /// Whether every owner in the map is below the number of slots. If not, the next map arrives before the next frame.
  bool fits() const noexcept { return fits_; }
  /// Who shares objects with these bounds: `all` if they touch only this node's region.
  regions::Coverage coverage(const geometry::Bounds& bounds) const noexcept {
    return geometry::contains(interior_, bounds) || geometry::contains(densest_box_, bounds)
               ? regions::Coverage::all
               : map_.coverage(bounds, node_);
  }
  /// The node that owns the cell of `position`.
  NodeNumber owner_at(const Vec3d& position) const noexcept;
  /// The same for this node; faster if one node owns everything.
  bool contains(const Vec3d& position) const noexcept {
    return map_.sole_owner() == node_ || owner_at(position) == node_;
  }

  /// Whether the entries of a `region_map` message fit the grid and, with the last of them, make a complete table.
  bool is_acceptable(const messages::MessageView& message) const;
  /// Adds the entries of a `region_map` message. Returns true if the new map is complete; it is then the map.
  bool receive(const messages::MessageView& message);
  /// Takes a new map whose tables it shares.
  void take(const regions::RegionMap& map);
  /// Discards what has arrived of an incomplete map.
  void discard_entries() noexcept { entries_.clear(); }
  bool is_changed() const noexcept { return changed_; }
  /// Whether the map has changed since the last call.
  bool take_change() noexcept { return std::exchange(changed_, false); }

 private:
  void find_boxes();

  regions::RegionMap map_;
  const geometry::FixedSpace& space_;
  NodeNumber node_;
  std::uint32_t slots_;
  // Boxes that are entirely in the region: one covers most of it, the other most of a crowd in one cell.
  geometry::Bounds interior_, densest_box_;
  bool fits_ = true;
  bool changed_ = false;
  std::vector<std::uint32_t> entries_;  ///< of the new map, received so far
};

}  // namespace ringfence::nodes
