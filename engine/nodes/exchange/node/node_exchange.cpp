#include "nodes/exchange/node/node_exchange.hpp"

#include <algorithm>
#include <new>

#include "nodes/exchange/node/message_exchange.hpp"
#include "nodes/exchange/node/shared_exchange.hpp"

namespace ringfence::nodes {

using messages::Endpoint;
using messages::MessageType;

std::unique_ptr<NodeExchange> NodeExchange::make(NodeState& state) {
  if (state.setup.exchange == ExchangeKind::shared) {
    return std::make_unique<SharedExchange>(state);
  }
  return std::make_unique<MessageExchange>(state);
}

void NodeExchange::begin() {
  owned_.clear();
  next_hosts_.clear();
  changes_.clear();
  next_change_ = 0;
  states_run_.start();
  discard_ghosts();
}

// The server does not send the object back: it sends a node every object in its region except those that the node
// itself hosts and has reported.
bool NodeExchange::send_changes() {
  const messages::RunHeader head = state_.head(MessageType::node_state, Endpoint::server());
  for (; next_change_ < changes_.size(); ++next_change_) {
    std::byte* const where = states_run_.add(*state_.setup.server.out, head, record_bytes(), state_.traffic);
    if (where == nullptr) {
      return false;
    }
    const Change& change = changes_[next_change_];
    const Hosted& object = state_.host[change.hosted];
    auto* record = new (where) messages::NodeStateRecord{object.object, object.pose, change.bounds};
    record->object.flags = change.flags;
    std::copy_n(state_.host.state(change.hosted), state_.host.state_bytes(), where + sizeof *record);
  }
  changes_.clear();
  next_change_ = 0;
  return true;
}

bool NodeExchange::finish_changes() {
  return states_run_.finish(*state_.setup.server.out, state_.head(MessageType::node_state, Endpoint::server()),
                            record_bytes(), state_.traffic);
}

void NodeExchange::flush() {
  states_run_.flush(*state_.setup.server.out, state_.head(MessageType::node_state, Endpoint::server()), record_bytes(),
                    state_.traffic);
}

}  // namespace ringfence::nodes
