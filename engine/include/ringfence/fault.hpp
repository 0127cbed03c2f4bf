#pragma once

#include <cstddef>
#include <cstdint>

#include "ringfence/ids.hpp"

namespace ringfence {

/// The point of a frame at which an injected fault stops a role.
///
/// The first seven are steps of a CD node, in frame order. The node stops before the step that the enumerator names;
/// its thread continues to run. At the other points the role stops within a step and blocks its thread.
enum class NodeStage : std::uint8_t {
  moving,        ///< move the hosted objects and report their states to the server
  gathering,     ///< receive positions and candidate pairs, and test the pairs
  colliding,     ///< send contacts to the server
  ending,        ///< wait for the contacts of its hosted objects
  handing_over,  ///< hand objects over to other nodes
  settling,      ///< wait for objects handed over by other nodes
  reporting,     ///< report to the server that the frame is done
  model,         ///< before a batch of up to 64 objects is passed to the motion model; also for user nodes
  kernel,        ///< before a batch of up to 4096 pairs is tested; earlier batches of the frame are done
  gate,          ///< inside a read gate, where the node reads memory of other nodes
  hand_over,     ///< before objects are handed over to one of the other nodes
  publication    ///< before the states that the role has written are published; also for user nodes
};
inline constexpr std::size_t boundary_stage_count = 7;  ///< number of stages at which a node stops between two steps
inline constexpr std::size_t node_stage_count = 12;
/// Name of a stage: that of the enumerator.
constexpr const char* name_of(NodeStage stage) noexcept {
  constexpr const char* names[] = {"moving",    "gathering", "colliding", "ending", "handing_over", "settling",
                                   "reporting", "model",     "kernel",    "gate",   "hand_over",    "publication"};
  return names[static_cast<std::size_t>(stage)];
}

/// A fault to inject, to test failover; see World::inject. A role that does not reach the point in that frame does not
/// stop.
struct Fault {
  NodeId node;              ///< the CD node that stops; ignored if `user` is set
  std::uint64_t frame = 0;  ///< number of the frame, from 0, as in FrameReport::frame
  NodeStage stage = NodeStage::moving;
  double stall_ms = 0;       ///< how long the role does nothing, milliseconds; 0: until World::release_faults
  UserId user = no_user;     ///< if set, this user node stops, not a CD node; `stage` is model or publication
  std::uint32_t passes = 0;  ///< how often the role passes the point in that frame before it stops
};

}  // namespace ringfence
