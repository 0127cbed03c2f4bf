#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include "geometry/bounds.hpp"

namespace ringfence::bench {

/// Some frames of a world of boxes, played in a loop.
///
/// Coordinates are multiples of 256, so that `>> 8` is exact in a float and every peer gets the same boxes.
struct BoxFrames {
  std::vector<std::vector<geometry::Bounds>> frames;
  std::vector<std::uint8_t> present;
  std::vector<std::uint8_t> resting;  ///< the same for all frames
};

/// The worlds:
/// - cluster: half extents 0.6 to 1.2 m, 6 % of a cube, gathered around moving targets (n / 50): the paper's world;
/// - uniform: the same, evenly distributed;
/// - spot: the same in one Gaussian heap in a world 1000 times as wide; one percent is scattered over the world;
/// - line: the same on the y axis, as much gap as box;
/// - sizes: from 1 cm to 1 km, equal volume for all sizes, 6 % of a cube;
/// - still30, still60, still90: cluster with 30, 60 or 90 % of the boxes at rest.
/// Moving boxes move up to 0.15 m per frame and axis. Slots are in no spatial order.
const std::vector<std::string>& box_world_names();
BoxFrames make_box_world(const std::string& name, std::size_t boxes);

/// An implementation that finds all pairs, ours or a peer's. `find` is timed.
class PairFinder {
 public:
  virtual ~PairFinder() = default;
  virtual const std::vector<geometry::CandidatePair>& pairs() = 0;  ///< of the last find(), for the comparison
  virtual std::size_t find(const BoxFrames& world, std::size_t frame) = 0;
};

PairFinder* make_embree(const BoxFrames& world);
PairFinder* make_cgal(const BoxFrames& world);
PairFinder* make_bullet(const BoxFrames& world);

}  // namespace ringfence::bench
