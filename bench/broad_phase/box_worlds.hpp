#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include "geometry/bounds.hpp"

namespace ringfence::bench {

/// Some frames of a world of boxes, played in a circle.
///
/// Coordinates are multiples of 256, so that `>> 8` is exact in a float and every peer sees the same boxes.
struct BoxFrames {
  std::vector<std::vector<geometry::Bounds>> frames;
  std::vector<std::uint8_t> present;
  std::vector<std::uint8_t> resting;  ///< of every frame
};

/// - cluster: half-extents 0.6 to 1.2 m, 6 % of a cube, gathered around wandering targets (n / 50): the paper's world;
/// - uniform: the same, spread evenly;
/// - spot: the same in one Gaussian heap in a world a thousand times as wide, a hundredth of them strewn about;
/// - line: the same on the y axis, boxes and gaps in balance;
/// - sizes: from 1 cm to 1 km, volume spread evenly over the sizes, 6 % of a cube;
/// - still30, still60, still90: cluster, so many of a hundred boxes at rest.
/// All that moves moves up to 0.15 m a frame and axis. Slots are in no spatial order.
const std::vector<std::string>& box_world_names();
BoxFrames make_box_world(const std::string& name, std::size_t boxes);

/// A peer's or our own way to find all pairs. `find` is what is timed.
class PairFinder {
 public:
  virtual ~PairFinder() = default;
  virtual const std::vector<geometry::CandidatePair>& pairs() = 0;  ///< of the last find, for the comparison
  virtual std::size_t find(const BoxFrames& world, std::size_t frame) = 0;
};

PairFinder* make_embree(const BoxFrames& world);
PairFinder* make_cgal(const BoxFrames& world);
PairFinder* make_bullet(const BoxFrames& world);

}  // namespace ringfence::bench
