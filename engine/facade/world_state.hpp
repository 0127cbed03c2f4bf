#pragma once

#include <algorithm>
#include <array>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <vector>

#include "base/block_pool.hpp"
#include "facade/results/world_log.hpp"
#include "facade/threads/inline_roles.hpp"
#include "facade/threads/worker.hpp"
#include "facade/threads/worker_starter.hpp"
#include "geometry/shape_table.hpp"
#include "link/doorbell.hpp"
#include "nodes/exchange/node_contacts.hpp"
#include "nodes/exchange/publications.hpp"
#include "nodes/fault_point.hpp"
#include "nodes/server/server_setup.hpp"
#include "regions/region_map.hpp"
#include "ringfence/config.hpp"
#include "telemetry/track.hpp"

namespace ringfence::facade {

/// What the roles of a World and the parts of its facade share. Roles receive pointers to the members in their setups;
/// parts hold a reference to the whole. So it does not move, and outlives all of them.
///
/// Threads: the one that calls World uses it. What roles read and write is under the contracts of its type.
struct WorldState {
  /// Throws Error if the configuration is invalid. Starts no thread. `first`: the number of the first frame.
  explicit WorldState(WorldConfig given, std::uint64_t first = 0);
  WorldState(const WorldState&) = delete;
  WorldState& operator=(const WorldState&) = delete;

  /// Whether roles have threads of their own. If not, the thread that calls World steps all of them.
  bool threaded() const noexcept { return config.nodes > 0; }
  /// One kind for the whole world: nodes in other processes share no memory.
  nodes::ExchangeKind exchange_kind() const noexcept {
    return config.remote_nodes == nullptr ? nodes::ExchangeKind::shared : nodes::ExchangeKind::messages;
  }
  /// How the server controls the frames of the CD nodes; null if it does so by messages.
  nodes::FrameControl* frame_control() noexcept {
    return exchange_kind() == nodes::ExchangeKind::shared ? &shared_control : nullptr;
  }
  /// Whether a CD node of this process may be lost.
  bool nodes_may_be_lost() const noexcept { return threaded() && config.deadlines.node_ms > 0; }
  /// Whether the CD nodes, not the server, publish the objects for the user nodes: unless a node is lost.
  bool nodes_publish() const noexcept {
    return config.deployment == Deployment::user_collision && config.placement == Placement::region &&
           exchange_kind() == nodes::ExchangeKind::shared;
  }
  /// Number of frames whose publications and contacts are kept. One thread has read those of frame k before it writes
  /// those of frame k + 1.
  std::size_t kept_frames() const noexcept { return threaded() ? 2 : 1; }
  /// Size of a ring whose role uses `by_role` bytes by default. Without threads a large ring saves no wake-ups.
  std::size_t ring_bytes(std::size_t by_role) const noexcept {
    constexpr std::size_t most_in_one_thread = std::size_t{1} << 14;
    const std::size_t by_default = threaded() ? by_role : std::min(by_role, most_in_one_thread);
    return config.tuning.ring_bytes != 0 ? config.tuning.ring_bytes : by_default;
  }
  /// The setup of the server, except for the connections with the first CD nodes.
  nodes::ServerSetup server_setup() noexcept;
  /// The region map of the first frame: equal shares for the nodes of the configuration.
  regions::RegionMap first_map() const;

  /// At the cut: if the configuration leaves the bounds to the World, and the cut has the first objects, chooses the
  /// bounds around them. No role has used `space` for an object before.
  void choose_bounds();

  /// If roles have threads: starts that of the server. Throws Error if the system has none.
  void start_server_thread();
  /// The doorbell of the server's thread; null without threads.
  link::Doorbell* server_bell() noexcept { return server_worker != nullptr ? &server_worker->bell() : nullptr; }
  /// Sets the roles that the server's thread steps, in this order. Without threads: those that step_until steps.
  void assign_server_thread(std::vector<Steppable> roles);

  const std::uint64_t first_frame;  ///< not 0 if the World is restored
  /// Whether the next cut with objects chooses the bounds.
  bool bounds_are_open;
  WorldConfig config;                                         ///< settled; only choose_bounds() changes it
  const std::shared_ptr<geometry::ShapeTable> shared_shapes;  ///< shared with snapshots, which may outlive the World
  geometry::ShapeTable& shapes;
  geometry::FixedSpace space;                       ///< constant once the World has objects
  const std::array<std::uint32_t, 32> layer_masks;  ///< by layer: the layers it collides with
  nodes::Publications publications;
  nodes::Publication server_publication;
  link::Doorbell caller_bell;
  nodes::FrameOrder order;
  nodes::FrameControl shared_control;
  base::BlockPool<nodes::NodeContacts> node_contacts;             ///< of the CD nodes of this process, retired ones too
  base::BlockPool<nodes::HostPublication> publications_of_nodes;  ///< the same
  Halt halt;
  nodes::FaultRelease faults;
  WorldLog log;
  WorkerStarter starter;
  InlineRoles inline_roles;
  telemetry::Track server_track;
  std::unique_ptr<Worker> server_worker;  ///< null without threads
};

}  // namespace ringfence::facade
