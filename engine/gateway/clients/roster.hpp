#pragma once

#include <cstddef>
#include <functional>
#include <memory>
#include <string>
#include <unordered_map>
#include <vector>

#include "gateway/clients/client.hpp"
#include "ringfence/gateway.hpp"
#include "ringfence/world.hpp"

namespace ringfence::gateway {

/// Who is connected, which user of the World each player has, and which players are away.
///
/// A player whose connection ends stays for a grace period, and gets its avatar back if it connects again in time. A
/// new connection of a user replaces the old one. Guests get user numbers in turn, so that a number is used again as
/// late as possible.
class Roster {
 public:
  /// Finds the players that the world has already. `grace`: frames.
  Roster(World& world, const GatewayHooks& hooks, Stamp grace);

  /// Admits a connection, or adds its end to `outbox`.
  void open(ConnectionId connection, const Identity& identity, Stamp now, Outbox& outbox);
  void close(ConnectionId connection, Stamp now);
  /// Removes the players whose grace period is over.
  void expire(Stamp now);

  /// Null if there is no such connection, or no such player.
  Client* find(ConnectionId connection) noexcept;
  Client* find(UserId user) noexcept;
  /// All clients, those that are away too, in no particular order. Valid until the next call of open() or expire().
  const std::vector<std::unique_ptr<Client>>& clients() const noexcept { return clients_; }
  std::size_t connected() const noexcept { return by_connection_.size(); }

 private:
  void find_players();
  /// A new player, a guest if `user` is no_user; null if it is refused, then `refusal` says why.
  Client* admit_player(UserId user, std::string& refusal);
  UserId connect_guest();
  Client& add(std::unique_ptr<Client> client);
  void remove(const Client& client);

  World& world_;
  const GatewayHooks& hooks_;
  Stamp grace_;
  std::uint32_t next_guest_ = 0;
  std::vector<std::unique_ptr<Client>> clients_;
  std::unordered_map<ConnectionId, Client*> by_connection_;
  std::unordered_map<UserId, Client*> by_user_;
};

}  // namespace ringfence::gateway
