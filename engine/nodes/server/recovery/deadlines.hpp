#pragma once

#include <cstdint>

#include "nodes/server/frame/dispatch.hpp"
#include "nodes/server/recovery/failover.hpp"
#include "nodes/server/server_state.hpp"

namespace ringfence::nodes {

/// Deadlines of CD nodes and user nodes (ServerSetup). A node that is silent is probed, then lost. A user node that has
/// not reported its moves in time is late. A thread of a lost node that has stopped inside a read gate costs all nodes.
///
/// Threads: belongs to the server role.
class Deadlines {
 public:
  Deadlines(ServerState& state, Failover& failover, Dispatch& dispatch) noexcept
      : state_(state), failover_(failover), dispatch_(dispatch) {}

  /// At the cut.
  void begin() noexcept;
  /// User nodes begin to move, at `now` (telemetry time, ns).
  void begin_moves(std::uint64_t now) noexcept { moves_watched_ns_ = now; }
  /// Whether a frame is running and there are deadlines.
  bool is_watching() const noexcept {
    return state_.stage != FrameStage::waiting &&
           (state_.setup.node_deadline_ns != 0 || state_.setup.user_deadline_ns != 0);
  }
  /// Call it if is_watching() and the frame makes no progress. Returns whether a node was lost or a user node was late.
  bool check(std::uint64_t now);
  /// Whether all nodes were lost in this frame because the thread of one has stopped inside a read gate.
  bool has_abandoned_nodes() const noexcept { return nodes_abandoned_; }

 private:
  bool check_node(PeerSession& node, std::uint64_t now);
  bool check_gates(std::uint64_t now);
  bool check_users(std::uint64_t now);
  bool check_moves(std::uint64_t now);
  bool is_awaited(const UserConnection& peers, const PeerSession& user) const noexcept;
  void count_late(PeerSession& user);

  ServerState& state_;
  Failover& failover_;
  Dispatch& dispatch_;
  bool nodes_abandoned_ = false;
  std::uint64_t gates_watched_ns_ = 0;  ///< since when the frame waits for lost nodes to leave their gates; 0: no wait
  std::uint64_t moves_watched_ns_ = 0;  ///< when user nodes began to move, or the facade last checked their threads
};

}  // namespace ringfence::nodes
