#pragma once

#include <cstdint>
#include <span>

#include "base/numbers.hpp"
#include "base/prefetch.hpp"
#include "geometry/bounds.hpp"
#include "narrow_phase/narrow_phase.hpp"
#include "nodes/cd_node/node_state.hpp"
#include "regions/region_map.hpp"

namespace ringfence::nodes {

/// What a node that sweeps reads of the objects of a candidate pair, by index into RegionObjects.
///
/// Threads: belongs to the CD node. Valid until an object is added to or removed from the region.
class PairObjects {
 public:
  explicit PairObjects(const NodeState& state)
      : map_(state.region.map()),
        node_(state.setup.node),
        marks_(state.objects.marks()),
        bounds_(state.objects.bounds()),
        numbers_(state.objects.numbers()),
        bodies_(state.objects.bodies()) {}

  /// Whether this node tests the pair. An object fully inside its region cannot collide in another one.
  bool owns(const geometry::CandidatePair& pair) const noexcept {
    return ((marks_[pair.a] | marks_[pair.b]) & RegionObjects::inner_mark) != 0 ||
           map_.pair_owner(bounds_[pair.a], bounds_[pair.b]) == node_;
  }
  /// The pair with the lower number first; prefetches its bodies.
  geometry::CandidatePair ordered(const geometry::CandidatePair& pair) const noexcept {
    base::prefetch_for_read(&bodies_[pair.a]);
    base::prefetch_for_read(&bodies_[pair.b]);
    // Without a branch: half of all pairs are in the wrong order, at random, so a branch would often be mispredicted.
    const std::uint32_t flip = (pair.a ^ pair.b) & (numbers_[pair.b] < numbers_[pair.a] ? ~0u : 0u);
    return {pair.a ^ flip, pair.b ^ flip};
  }

 private:
  const regions::RegionMap& map_;
  NodeNumber node_;
  std::span<const std::uint8_t> marks_;
  std::span<const geometry::Bounds> bounds_;
  std::span<const ObjectNumber> numbers_;
  std::span<const narrow_phase::Body> bodies_;
};

}  // namespace ringfence::nodes
