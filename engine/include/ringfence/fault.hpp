#pragma once

#include <cstddef>
#include <cstdint>

#include "ringfence/ids.hpp"

namespace ringfence {

/// What a CD node is about to do when it fails, in the order of a frame.
enum class NodeStage : std::uint8_t {
  moving,        ///< tells the server what it moved
  gathering,     ///< hears of its region and of its pairs
  colliding,     ///< tells the server what it found
  ending,        ///< waits for what concerns its objects
  handing_over,  ///< gives objects to other nodes
  settling,      ///< waits for what others give it
  reporting      ///< tells the server that the frame is complete
};
inline constexpr std::size_t node_stage_count = 7;
constexpr const char* name_of(NodeStage stage) noexcept {
  constexpr const char* names[] = {"moving", "gathering", "colliding", "ending", "handing_over", "settling", "reporting"};
  return names[static_cast<std::size_t>(stage)];
}

/// A failure to order, so that what follows from it can be tested: see World::inject.
struct Fault {
  NodeNumber node = 0;
  std::uint64_t frame = 0;  ///< counted from 0, as in FrameReport
  NodeStage stage = NodeStage::moving;
  double stall_ms = 0;  ///< how long the node does nothing; 0: for ever
};

}  // namespace ringfence
