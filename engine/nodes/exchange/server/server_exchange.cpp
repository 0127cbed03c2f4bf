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

void ServerExchange::count(Statistics& statistics, const Exchanged& exchanged) const noexcept {
  const std::uint64_t ghosts = ghosts_exchanged_ ? exchanged.ghosts : 0;
  state_.report().ghost_updates += ghosts;
  statistics.count_shared(Traffic::m2, ghosts, sizeof(messages::PositionRecord));
  statistics.count_shared(Traffic::m4, exchanged.contacts, sizeof(Contact));
}

}  // namespace ringfence::nodes
