#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

namespace ringfence::bench {

/// How many records of each kind passed between the server and one CD node in one frame.
struct NodeTraffic {
  std::size_t states = 0;      ///< node_state: what the node hosts and moved
  std::size_t positions = 0;   ///< position_update
  std::size_t pairs = 0;       ///< M2
  std::size_t collisions = 0;  ///< M3
  std::size_t confirms = 0;    ///< M4, 64 contacts each
};

/// The messages between the server and its CD nodes in one frame of a real world.
struct FrameTraffic {
  std::vector<NodeTraffic> nodes;
  std::size_t state_bytes = 0;  ///< of the model, behind each record of a state
};

/// Runs the paper's world with mixed shapes, the broad phase on the server, in user/collision deployment, without user
/// nodes, until crowds have formed, and counts one frame.
FrameTraffic count_frame(std::uint32_t objects, std::uint32_t nodes);

}  // namespace ringfence::bench
