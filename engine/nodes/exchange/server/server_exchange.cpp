#include "nodes/exchange/server/server_exchange.hpp"

#include "nodes/exchange/server/message_server_exchange.hpp"
#include "nodes/exchange/server/shared_server_exchange.hpp"

namespace ringfence::nodes {

std::unique_ptr<ServerExchange> ServerExchange::make(ServerState& state) {
  if (state.setup.exchange == ExchangeKind::shared) {
    return std::make_unique<SharedServerExchange>(state);
  }
  return std::make_unique<MessageServerExchange>(state);
}

void ServerExchange::start_run(messages::RunSender& run, messages::MessageType type,
                               std::size_t records) const noexcept {
  if (!reads_nodes_ || records != 0) {
    return run.start(records);
  }
  run.stop();
  messages::count_message(state_.report().traffic, state_.head(type, messages::Endpoint::none()), 0, 0);
}

void ServerExchange::count_records(Statistics& statistics) const noexcept {
  for (const PeerSession& node : state_.nodes) {
    if (state_.nodes_host() && node.is_active()) {
      const auto [sent, contacts] = exchanged(node);
      const std::uint64_t ghosts = ghosts_exchanged_ ? sent : 0;
      state_.report().ghost_updates += ghosts;
      statistics.count_shared(Traffic::m2, ghosts, sizeof(messages::PositionRecord));
      statistics.count_shared(Traffic::m4, contacts, sizeof(Contact));
    }
  }
}

}  // namespace ringfence::nodes
