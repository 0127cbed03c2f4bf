#pragma once

#include "nodes/exchange/server/server_exchange.hpp"
#include "nodes/server/server_state.hpp"

namespace ringfence::nodes {

/// Sends every host its changes of the cut, and begins its frame: a host that receives the begin knows what it hosts.
///
/// Threads: belongs to the server role. Allocates only when more users than ever before have changes.
class FrameOpening {
 public:
  FrameOpening(ServerState& state, ServerExchange& exchange) : state_(state), exchange_(exchange) {}

  /// After the cut: prepares what open() sends, and resets what is received from the nodes.
  void start_nodes();
  /// Sends a node its changes, then `frame_begin` or its announcement. Sends as much as the ring takes; true when all
  /// is sent.
  bool open(PeerSession& node);
  /// Whether open() has something to send. True for each node of another process until it has all.
  bool has_opening(const PeerSession& node) const noexcept {
    return node.changes || state_.map_change.precedes_frame || !node.begin_run.done();
  }
  /// The same two for the users, while the nodes already move. Awaits the users' states.
  void start_users();
  bool open_users();

 private:
  void start(PeerSession& node);
  void forget_changes() noexcept;
  static void start_runs(PeerSession::Opening& opening) noexcept;
  bool send_changes(PeerSession& session);

  ServerState& state_;
  ServerExchange& exchange_;
};

}  // namespace ringfence::nodes
