#include "gateway/clients/roster.hpp"

#include <algorithm>
#include <utility>

namespace ringfence::gateway {

Roster::Roster(World& world, const GatewayHooks& hooks, Stamp grace) : world_(world), hooks_(hooks), grace_(grace) {
  if (hooks_.spawn) find_players();
}

// The lowest-numbered avatar of each user.
void Roster::find_players() {
  for (const ObjectView& object : world_.objects()) {
    if (object.spec.category != Category::avatar || by_user_.contains(object.spec.user)) continue;
    auto client = std::make_unique<Client>();
    client->user = object.spec.user;
    client->avatar = object.id;
    client->away_since = world_.frames();
    by_user_.emplace(client->user, client.get());
    clients_.push_back(std::move(client));
  }
}

Client* Roster::find(ConnectionId connection) noexcept {
  const auto found = by_connection_.find(connection);
  return found == by_connection_.end() ? nullptr : found->second;
}

Client* Roster::find(UserId user) noexcept {
  const auto found = by_user_.find(user);
  return found == by_user_.end() ? nullptr : found->second;
}

Client& Roster::add(std::unique_ptr<Client> client) {
  clients_.push_back(std::move(client));
  return *clients_.back();
}

UserId Roster::connect_guest() {
  const auto limit = static_cast<std::uint32_t>(world_.config().limits.users);
  for (std::uint32_t i = 0; i < limit; ++i) {
    const UserId user((next_guest_ + i) % limit);
    // The embedder may have users of its own.
    if (by_user_.contains(user) || world_.connect(user).status != Status::ok) continue;
    next_guest_ = user.number() + 1;
    return user;
  }
  return no_user;
}

Client* Roster::admit_player(UserId user, std::string& refusal) {
  const bool is_guest = !user;
  if (is_guest) {
    user = connect_guest();
    refusal = "no user number is free";
    if (!user) return nullptr;
  } else if (const Connected connected = world_.connect(user); connected.status != Status::ok) {
    refusal = std::string("the world refuses the user: ") + name_of(connected.status);
    return nullptr;
  }
  const ObjectId avatar = hooks_.spawn(user);
  if (!avatar) {
    static_cast<void>(world_.disconnect(user));
    refusal = "the world has no place for another avatar";
    return nullptr;
  }
  auto client = std::make_unique<Client>();
  client->user = user;
  client->avatar = avatar;
  client->is_guest = is_guest;
  Client& added = add(std::move(client));
  by_user_.emplace(user, &added);
  return &added;
}

void Roster::open(ConnectionId connection, const Identity& identity, Stamp now, Outbox& outbox) {
  Client* client = nullptr;
  if (identity.role != Role::play) {
    client = &add(std::make_unique<Client>());
    client->role = identity.role;
  } else if (!hooks_.spawn) {
    outbox.closes.push_back({connection, CloseCode::forbidden, "this world has spectators only; connect to /watch"});
    return;
  } else if (client = identity.user ? find(identity.user) : nullptr; client == nullptr) {
    std::string refusal;
    client = admit_player(identity.user, refusal);
    if (client == nullptr) {
      outbox.closes.push_back({connection, CloseCode::full, std::move(refusal)});
      return;
    }
  } else if (client->connection != 0) {
    by_connection_.erase(client->connection);
    outbox.closes.push_back({client->connection, CloseCode::replaced, "this user has connected again"});
  }
  client->connect(connection, now);
  by_connection_.emplace(connection, client);
}

void Roster::close(ConnectionId connection, Stamp now) {
  Client* const client = find(connection);
  if (client == nullptr) return;
  by_connection_.erase(connection);
  client->connection = 0;
  client->away_since = now;
  client->input.release();
  if (client->role != Role::play) remove(*client);
}

void Roster::expire(Stamp now) {
  std::vector<const Client*> expired;
  for (const auto& client : clients_) {
    if (client->connection == 0 && client->away_since + grace_ <= now) expired.push_back(client.get());
  }
  for (const Client* client : expired) {
    if (hooks_.left) hooks_.left(client->user);
    static_cast<void>(world_.disconnect(client->user));  // refused only if the embedder has disconnected it
    by_user_.erase(client->user);
    remove(*client);
  }
}

void Roster::remove(const Client& client) {
  const auto found = std::ranges::find(clients_, &client, &std::unique_ptr<Client>::get);
  std::swap(*found, clients_.back());
  clients_.pop_back();
}

}  // namespace ringfence::gateway
