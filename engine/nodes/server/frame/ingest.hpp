#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <utility>

#include "base/flat_list.hpp"
#include "base/numbers.hpp"
#include "messages/header.hpp"
#include "nodes/exchange/server/server_exchange.hpp"
#include "nodes/server/frame/node_results.hpp"
#include "nodes/server/frame/report_reader.hpp"
#include "nodes/server/frame/statistics.hpp"
#include "nodes/server/objects/object_states.hpp"
#include "nodes/server/server_state.hpp"

namespace ringfence::nodes {

/// Reads the messages of CD nodes and user nodes, checks them, and stores what they contain: states in the object
/// table, contacts in the ledger, reports in Statistics, and in PeerSession::received what has arrived. CD nodes of
/// this process report in shared memory (StepReport), and send messages only where they have records.
///
/// User nodes and nodes of other processes are not trusted: what they may not send now, or what is not valid, is
/// refused and counted. A node of another process that breaks the protocol becomes PeerSession::broken.
///
/// Threads: belongs to the server role.
class Ingest {
 public:
  Ingest(ServerState& state, ServerExchange& exchange, ObjectStates& states, Statistics& statistics) noexcept
      : state_(state),
        exchange_(exchange),
        states_(states),
        statistics_(statistics),
        results_(state, exchange, states, statistics),
        reports_(state, results_, statistics) {}

  /// At the cut: nothing has been reported in this frame.
  void begin() noexcept { reports_.begin(); }
  /// Whether all nodes that are not lost have completed a step.
  bool all_completed(ReportedStep step);
  /// Reads what the roles have sent for which the frame waits. Returns whether there was any message.
  bool receive();
  /// Refuses what lost nodes still send. Returns whether there was any message.
  bool refuse_lost();
  /// Whether a node has become broken since the last call.
  bool take_broken() noexcept { return std::exchange(any_broken_, false); }

 private:
  bool is_awaited(const PeerSession& node) const noexcept;
  bool receive_reports();
  bool receive_from_senders();
  bool receive_from_users();
  bool drain(PeerSession& node);
  bool drain(UserConnection& peers);
  void receive_from_user(UserConnection& peers, std::span<const std::byte> bytes);
  bool receive_from_all(UserConnection& peers, const messages::MessageView& message);
  /// Objects that a user may host beside its avatars.
  std::size_t shared_objects() const noexcept {
    return state_.setup.deployment == Deployment::user ? state_.objects.live() : 0;
  }
  /// `bytes`: size of the message; `valid`: its view, null if it is not valid.
  bool is_over_quota(PeerSession& user, std::size_t bytes, const messages::MessageView* valid);
  bool may_send(const PeerSession& session, const messages::MessageView& message) const noexcept;
  bool is_acceptable(const PeerSession& node, const messages::MessageView& message) const noexcept;
  void receive(PeerSession& session, const messages::MessageView& message);
  void receive_states(PeerSession& user, const messages::MessageView& message);
  void receive_node_states(PeerSession& node, const messages::MessageView& message);
  void receive_replicas(PeerSession& node, const messages::MessageView& message);
  void receive_collisions(PeerSession& node, const messages::MessageView& message);
  void receive_changes(PeerSession& node, const messages::MessageView& message);
  void refuse(PeerSession& sender, Status reason, ObjectNumber number = 0);

  ServerState& state_;
  ServerExchange& exchange_;
  ObjectStates& states_;
  Statistics& statistics_;
  NodeResults results_;
  ReportReader reports_;                ///< unused if nodes share no memory
  base::FlatList<NodeNumber> senders_;  ///< scratch
  bool any_broken_ = false;             ///< a node that is not lost yet has broken the protocol
};

}  // namespace ringfence::nodes
