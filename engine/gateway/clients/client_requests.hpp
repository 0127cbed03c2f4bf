#pragma once

#include <cstdint>
#include <span>

#include "gateway/clients/client.hpp"
#include "gateway/protocol/client_messages.hpp"
#include "gateway/protocol/server_messages.hpp"
#include "gateway/transport.hpp"
#include "ringfence/gateway.hpp"
#include "ringfence/world.hpp"

namespace ringfence::gateway {

/// Appends a message with that body to `outbox`, delivered reliably.
void send_body(ConnectionId connection, ServerMessageType type, std::span<const std::byte> body, Outbox& outbox);
void send_body(ConnectionId connection, ServerMessageType type, std::string_view body, Outbox& outbox);

/// Does what clients ask for in their messages. Messages that are malformed, out of order or not permitted end the
/// connection.
class ClientRequests {
 public:
  ClientRequests(World& world, const GatewayHooks& hooks) : world_(world), hooks_(hooks) {}

  /// `now`: number of complete frames. `received_s`: when the message arrived, seconds of a steady clock.
  void handle(Client& client, std::span<const std::byte> message, Stamp now, double received_s, Outbox& outbox);
  /// Number of messages that were refused.
  std::uint64_t refused() const noexcept { return refused_; }

 private:
  // Each returns null, or why the message is refused.
  const char* handle(Client& client, const Malformed& message);
  const char* handle(Client& client, const Hello& message);
  const char* handle(Client& client, const Input& message);
  const char* handle(Client& client, const Ack& message);
  const char* handle(Client& client, const GetShape& message);
  const char* handle(Client& client, const Application& message);
  const char* handle(Client& client, const View& message);
  const char* handle(Client& client, const Describe& message);
  const char* handle(Client& client, const Command& message);
  const char* acknowledge(Client& client, std::uint64_t ack) const noexcept;
  std::string kill(std::uint32_t node);

  World& world_;
  const GatewayHooks& hooks_;
  std::uint64_t refused_ = 0;
  // Of the message that is handled.
  Stamp now_ = 0;
  double received_s_ = 0;
  Outbox* outbox_ = nullptr;
};

}  // namespace ringfence::gateway
