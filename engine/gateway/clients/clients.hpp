#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <span>
#include <string>
#include <vector>

#include "gateway/clients/client_requests.hpp"
#include "gateway/clients/object_table.hpp"
#include "gateway/clients/player_view.hpp"
#include "gateway/clients/roster.hpp"
#include "gateway/clients/spectator_view.hpp"
#include "gateway/clients/static_objects.hpp"
#include "gateway/clients/status_text.hpp"
#include "gateway/protocol/server_messages.hpp"
#include "gateway/transport.hpp"
#include "ringfence/gateway.hpp"
#include "ringfence/world.hpp"

namespace ringfence::gateway {

/// What a Gateway does on the thread of the frames, over any transport: reads clients' messages before a frame, and
/// sends them what they see after it.
class Clients {
 public:
  /// Makes the token with which a guest can come back.
  using GuestToken = std::function<std::string(UserId)>;

  /// All arguments outlive this object.
  Clients(World& world, const GatewayConfig& config, Transport& transport, GuestToken guest_token);

  void before_frame();
  void after_frame();
  bool send(UserId user, std::span<const std::byte> bytes);
  /// Closes all connections.
  void close_all(CloseCode code, const std::string& reason);

  struct Counts {
    std::size_t players = 0, spectators = 0, away = 0;
  };
  Counts counts() const noexcept;
  std::uint64_t updates() const noexcept { return updates_; }
  std::uint64_t refused() const noexcept { return requests_.refused(); }

 private:
  void receive();
  void apply_inputs();
  void look_at_world();
  void send_update(Client& client);
  void send_welcome(Client& client);
  void send_status(Client& client);
  void add_metadata();
  bool is_due(const Client& client) const noexcept;
  bool needs_status(const Client& client) const noexcept;

  World& world_;
  const GatewayConfig& config_;
  Transport& transport_;
  GuestToken guest_token_;
  Stamp status_period_;     ///< frames
  Stamp spectator_period_;  ///< frames
  double started_s_;
  Inbox inbox_;
  Outbox outbox_;
  Roster roster_;
  ObjectTable table_;
  StaticObjects static_objects_;
  PlayerView player_view_;
  SpectatorView spectator_view_;
  ClientRequests requests_;
  StatusText status_;
  std::vector<ObjectView> objects_;  ///< of the world, in frames that need them
  Update update_;
  std::vector<std::byte> metadata_;
  std::uint64_t updates_ = 0;
};

}  // namespace ringfence::gateway
