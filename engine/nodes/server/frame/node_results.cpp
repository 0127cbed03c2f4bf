#include "nodes/server/frame/node_results.hpp"

#include "nodes/server/frame/map_scheduler.hpp"

namespace ringfence::nodes {

// A node's results count only as a whole.
bool NodeResults::add_tests(PeerSession& node, const messages::NarrowDoneRecord& totals) {
  statistics_.add(node, totals);
  exchange_.receive_contacts(node, statistics_);
  node.received.narrow_done = true;
  if (state_.ledger.received(node.self.number()) != totals.contacts) {
    return false;
  }
  state_.report().accepted += totals.tested + totals.carried;
  return true;
}

void NodeResults::add_kinds(std::span<const messages::KindRecord> kinds) {
  for (const messages::KindRecord& kind : kinds) {
    statistics_.add(kind);
  }
}

void NodeResults::finish(PeerSession& node, const messages::NodeFrameStats& stats) {
  statistics_.add(node, stats);
  node.cost_ms = MapScheduler::cost_of(state_.setup, state_.report().nodes[node.in_report]);
  states_.add_moved(static_cast<std::int64_t>(stats.host_owned_changes));
  node.received.frame_done = true;
}

}  // namespace ringfence::nodes
