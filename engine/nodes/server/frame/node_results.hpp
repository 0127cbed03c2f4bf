#pragma once

#include <span>

#include "messages/records.hpp"
#include "nodes/exchange/server/server_exchange.hpp"
#include "nodes/server/frame/statistics.hpp"
#include "nodes/server/objects/object_states.hpp"
#include "nodes/server/server_state.hpp"

namespace ringfence::nodes {

/// Takes what the CD nodes report at the end of their steps, whether it came in messages or in shared memory: tests and
/// statistics go to the report of the frame, contacts to the ledger.
///
/// Threads: belongs to the server role.
class NodeResults {
 public:
  NodeResults(ServerState& state, ServerExchange& exchange, ObjectStates& states, Statistics& statistics) noexcept
      : state_(state), exchange_(exchange), states_(states), statistics_(statistics) {}

  /// The node has tested its pairs, and all its contacts are here. Returns false if these are not as many as it says:
  /// then its tests are not accepted.
  bool add_tests(PeerSession& node, const messages::NarrowDoneRecord& totals);
  void add_kinds(std::span<const messages::KindRecord> kinds);
  /// The node has completed the frame.
  void finish(PeerSession& node, const messages::NodeFrameStats& stats);

 private:
  ServerState& state_;
  ServerExchange& exchange_;
  ObjectStates& states_;
  Statistics& statistics_;
};

}  // namespace ringfence::nodes
