#pragma once

#include <string>
#include <vector>

#include "geometry/bounds.hpp"
#include "narrow_phase/narrow_phase.hpp"

namespace ringfence::narrow_phase_bench {

/// The input of the narrow phase in some frames of the paper's world with 64,000 objects of mixed shapes: all bodies,
/// and all candidates in the order of the sweep. The bodies of all frames exceed the second-level cache, so each frame
/// has the cache misses that a node has.
struct WorldPairs {
  struct Frame {
    std::vector<narrow_phase::Body> bodies;
    std::vector<geometry::CandidatePair> pairs;
  };
  const geometry::ShapeTable* shapes;
  std::vector<Frame> frames;
};

/// Recorded on first use; lives until the program ends.
const WorldPairs& world_pairs();

/// Registers narrow/world/<pairs>/ringfence, where <pairs> is `all` or <kind_a>_<kind_b>.
void add_world_pairs();

}  // namespace ringfence::narrow_phase_bench
