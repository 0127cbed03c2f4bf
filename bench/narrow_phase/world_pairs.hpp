#pragma once

#include <string>
#include <vector>

#include "geometry/bounds.hpp"
#include "narrow_phase/narrow_phase.hpp"

namespace ringfence::narrow_phase_bench {

/// What the narrow phase is given in some frames of the paper's world of 64,000 objects, mixed shapes, one frame after
/// another: every body, and all candidates in the order of the sweep. The bodies of all frames together are more than a
/// second-level cache holds, so whoever goes through the frames in turn finds each frame's bodies as cold as a node
/// does.
struct WorldPairs {
  struct Frame {
    std::vector<narrow_phase::Body> bodies;
    std::vector<geometry::CandidatePair> pairs;
  };
  const geometry::ShapeTable* shapes;
  std::vector<Frame> frames;
};

/// Recorded when first asked for; lives as long as the program.
const WorldPairs& world_pairs();

/// Registers narrow/world/<pairs>/ringfence, where <pairs> is `all` or <kind_a>_<kind_b>.
void add_world_pairs();

}  // namespace ringfence::narrow_phase_bench
