#pragma once

#include <cstddef>
#include <cstdint>

#include "ringfence/ids.hpp"

namespace ringfence {

/// The step of a frame at which an injected fault stops a CD node, in frame order. Each enumerator names what the node
/// does next.
enum class NodeStage : std::uint8_t {
  moving,        ///< report moved states to the server
  gathering,     ///< receive positions and candidate pairs
  colliding,     ///< send contacts to the server
  ending,        ///< wait for the contacts of its hosted objects
  handing_over,  ///< hand objects over to other nodes
  settling,      ///< wait for objects handed over by other nodes
  reporting      ///< report to the server that the frame is done
};
inline constexpr std::size_t node_stage_count = 7;
constexpr const char* name_of(NodeStage stage) noexcept {
  constexpr const char* names[] = {"moving",       "gathering", "colliding", "ending",
                                   "handing_over", "settling",  "reporting"};
  return names[static_cast<std::size_t>(stage)];
}

/// A fault to inject, for tests of failover: see World::inject.
struct Fault {
  NodeNumber node = 0;
  std::uint64_t frame = 0;  ///< counted from 0, like FrameReport::frame
  NodeStage stage = NodeStage::moving;
  double stall_ms = 0;  ///< how long the node does nothing; 0: for ever
};

}  // namespace ringfence
