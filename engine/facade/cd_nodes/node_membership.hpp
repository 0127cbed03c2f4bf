#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "base/numbers.hpp"
#include "facade/cd_nodes/cd_nodes.hpp"
#include "facade/requests/requests.hpp"
#include "facade/world_state.hpp"
#include "nodes/server/server_role.hpp"
#include "ringfence/frame_report.hpp"
#include "ringfence/status.hpp"

namespace ringfence::facade {

/// Which CD nodes a World has: those that World::resize asks for, remote nodes that come and go, and replacements of
/// lost ones. New nodes join at the next cut. At the end of that frame the nodes that leave hand everything over, and
/// are gone when it is complete.
///
/// Threads: the one that calls World; only resize() while a frame is running. Memory is allocated only when nodes join
/// or leave.
class NodeMembership {
 public:
  /// All three outlive this object.
  NodeMembership(WorldState& state, CdNodes& nodes, Requests& requests) noexcept
      : state_(state), nodes_(nodes), requests_(requests) {}
  NodeMembership(const NodeMembership&) = delete;
  NodeMembership& operator=(const NodeMembership&) = delete;

  /// See World::resize; refused calls are counted.
  Status resize(std::uint32_t count, const nodes::ServerRole& server);

  // The steps of a frame.
  /// A frame begins: adds the nodes that join, and the requests about those that join and leave to WorldState::order.
  void cut(nodes::ServerRole& server);
  /// The frame of `report` is complete: removes the nodes that were lost or have left. If none is left, a node that the
  /// server's thread steps joins at the next cut.
  void remove_gone(const FrameReport& report, nodes::ServerRole& server);

 private:
  bool prepare_threads(std::uint32_t count);
  void resize_local(nodes::ServerRole& server);
  void exchange_remote(nodes::ServerRole& server);
  std::vector<NodeNumber> remote_leavers(bool any_arrival) const;
  void request_partition(std::span<const NodeNumber> leavers);

  WorldState& state_;
  CdNodes& nodes_;
  Requests& requests_;
  std::uint32_t resize_to_ = 0;    ///< number of nodes from the frame after the next on; 0: no change
  std::uint32_t resizing_to_ = 0;  ///< number of nodes from the frame after this one on; 0: no change
};

}  // namespace ringfence::facade
