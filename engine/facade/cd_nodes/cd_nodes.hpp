#pragma once

#include <cstddef>
#include <memory>
#include <vector>

#include "base/numbers.hpp"
#include "facade/node_pool.hpp"
#include "facade/world_state.hpp"
#include "nodes/role.hpp"
#include "nodes/server/server_role.hpp"
#include "regions/region_map.hpp"
#include "ringfence/fault.hpp"
#include "ringfence/frame_report.hpp"

namespace ringfence::facade {

/// Whether the CD node with that id was lost in the frame of the report.
bool was_lost(const FrameReport& report, NodeNumber id) noexcept;

/// The CD nodes of a World: makes their channels by its configuration, and has the server's thread step the server, the
/// nodes without a thread of their own, and the bridge to remote nodes. NodeMembership decides which nodes there are.
///
/// Threads: the one that calls World, while no frame is running; replace_last() while the server waits for it. Memory
/// is allocated only when nodes join or leave.
class CdNodes {
 public:
  explicit CdNodes(WorldState& state);
  CdNodes(const CdNodes&) = delete;
  CdNodes& operator=(const CdNodes&) = delete;

  NodePool& pool() noexcept { return pool_; }
  const NodePool& pool() const noexcept { return pool_; }

  /// Makes the first nodes, or waits for remote ones. Returns the server's ends of the connections. Throws Error if the
  /// system has no thread for one, or the remote nodes do not come. Call connect() afterwards.
  std::vector<nodes::Connection> make_first(const regions::RegionMap& map);
  /// Call it after each change of the pool: connects the nodes with each other and starts to step them. `server` is
  /// stepped with them from then on.
  void connect(nodes::ServerRole& server);
  /// The last node was lost within a frame, as WorldState::order says: a fallback node, which the server's thread
  /// steps, takes its slot.
  void replace_last(nodes::ServerRole& server);
  /// Injects a fault into the node that it names. Returns false if that is unknown or in another process, or does not
  /// have the stage.
  bool inject(const Fault& fault, nodes::ServerRole& server);

 private:
  std::vector<Steppable> server_thread_roles(nodes::ServerRole& server) const;
  void assign_remote_nodes(nodes::ServerRole& server);

  WorldState& state_;
  NodePool pool_;
};

}  // namespace ringfence::facade
