#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>

#include "gateway/clients/known_objects.hpp"
#include "gateway/clients/newest_input.hpp"
#include "gateway/clients/own_contacts.hpp"
#include "gateway/protocol/client_messages.hpp"
#include "gateway/transport.hpp"
#include "ringfence/ids.hpp"

namespace ringfence::gateway {

/// A player, spectator or operator.
struct Client {
  ConnectionId connection = 0;  ///< 0: away
  Role role = Role::play;
  UserId user = no_user;  ///< of a player
  ObjectId avatar;        ///< of a player
  bool is_guest = false;
  bool is_welcomed = false;
  Stamp away_since = 0;
  Stamp complete = 0;      ///< acknowledgements of earlier frames do not count, since the connection began later
  Stamp acknowledged = 0;  ///< newest frame that the client has applied; 0: none
  Stamp last_update = 0;   ///< newest frame of which an update was made
  NewestInput input;
  KnownObjects known;
  OwnContacts contacts;
  std::optional<View> view;                 ///< of a spectator
  std::uint32_t map_epoch = 0;              ///< of the region map that a spectator has
  std::optional<std::size_t> status_nodes;  ///< number of nodes in the last status that a spectator received

  /// A new connection has this client: it knows nothing.
  void connect(ConnectionId new_connection, Stamp now) noexcept {
    connection = new_connection;
    is_welcomed = false;
    away_since = 0;
    complete = now + 1;
    acknowledged = 0;
    last_update = now;
    map_epoch = 0;
    status_nodes.reset();
    input.restart();
    known.forget();
    contacts.forget();
  }
};

}  // namespace ringfence::gateway
