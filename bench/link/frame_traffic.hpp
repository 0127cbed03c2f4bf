#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

namespace ringfence::bench {

/// Number of records of each type between the server and one CD node in one frame.
struct NodeTraffic {
  std::size_t states = 0;      ///< node_state: hosted objects that moved
  std::size_t positions = 0;   ///< position_update
  std::size_t pairs = 0;       ///< pairs
  std::size_t collisions = 0;  ///< collision
  std::size_t changes = 0;     ///< change
};

/// The messages between the server and its CD nodes in one frame of a simulated world.
struct FrameTraffic {
  std::vector<NodeTraffic> nodes;
  std::size_t state_bytes = 0;  ///< model state behind each state record
};

/// Simulates the paper's world with mixed shapes in user/collision deployment, with the broad phase on the server and
/// without user nodes, until crowds have formed. Then counts the records of one frame.
FrameTraffic count_frame(std::uint32_t objects, std::uint32_t nodes);

}  // namespace ringfence::bench
