#pragma once

#include <utility>

#include "base/flat_list.hpp"
#include "base/numbers.hpp"
#include "messages/header.hpp"
#include "nodes/exchange/server/server_exchange.hpp"
#include "nodes/server/frame/node_results.hpp"
#include "nodes/server/frame/report_reader.hpp"
#include "nodes/server/frame/reported_states.hpp"
#include "nodes/server/frame/statistics.hpp"
#include "nodes/server/objects/object_states.hpp"
#include "nodes/server/server_state.hpp"

namespace ringfence::nodes {

/// Reads the messages of CD nodes, checks them, and passes on what they contain: states to ReportedStates, contacts to
/// the ledger, reports to NodeResults, and to PeerSession::received what has arrived. CD nodes of this process report
/// in shared memory (StepReport), and send messages only where they have records.
///
/// Nodes of other processes are not trusted: what they may not send now, or what is not valid, is refused and counted,
/// and a node that breaks the protocol becomes PeerSession::broken.
///
/// Threads: belongs to the server role.
class NodeIngest {
 public:
  NodeIngest(ServerState& state, ServerExchange& exchange, ObjectStates& states, Statistics& statistics) noexcept
      : state_(state),
        exchange_(exchange),
        statistics_(statistics),
        reported_states_(state, states, statistics),
        results_(state, exchange, states, statistics),
        reports_(state, results_, statistics) {}

  /// At the cut: nothing has been reported in this frame.
  void begin() noexcept { reports_.begin(); }
  /// When all nodes have tested: counts the tests by kinds of shapes that nodes of this process have listed.
  void count_kinds() {
    if (state_.setup.frame_control != nullptr) {
      reports_.count_kinds();
    }
  }
  /// Whether all nodes that are not lost have completed a step.
  bool all_completed(ReportedStep step);
  /// Reads what the nodes have sent for which the frame waits. Returns whether there was any message.
  bool receive();
  /// Refuses what lost nodes still send. Returns whether there was any message.
  bool refuse_lost();
  /// Whether a node has become broken since the last call.
  bool take_broken() noexcept { return std::exchange(any_broken_, false); }

 private:
  bool is_awaited(const PeerSession& node) const noexcept;
  bool receive_reports();
  bool receive_from_senders();
  bool drain(PeerSession& node);
  bool may_send(const PeerSession& node, const messages::MessageView& message) const noexcept;
  bool is_acceptable(const PeerSession& node, const messages::MessageView& message) const noexcept;
  void receive(PeerSession& node, const messages::MessageView& message);
  bool take(PeerSession& node, const messages::MessageView& message);
  bool receive_collisions(PeerSession& node, const messages::MessageView& message);
  bool receive_changes(PeerSession& node, const messages::MessageView& message);
  void refuse(PeerSession& sender);

  ServerState& state_;
  ServerExchange& exchange_;
  Statistics& statistics_;
  ReportedStates reported_states_;
  NodeResults results_;
  ReportReader reports_;                ///< unused if nodes share no memory
  base::FlatList<NodeNumber> senders_;  ///< scratch
  bool any_broken_ = false;             ///< a node that is not lost yet has broken the protocol
};

}  // namespace ringfence::nodes
