#include "gateway/clients/client_requests.hpp"

#include <algorithm>
#include <string>
#include <variant>

#include "gateway/clients/status_text.hpp"

namespace ringfence::gateway {
namespace {

constexpr const char* for_players = "only players may send this message";
constexpr const char* for_spectators = "only spectators and operators may send this message";

}  // namespace

void send_body(ConnectionId connection, ServerMessageType type, std::span<const std::byte> body, Outbox& outbox) {
  const std::size_t offset = outbox.bytes.size();
  write_body(type, body, outbox.bytes);
  outbox.messages.push_back({connection, Delivery::reliable, static_cast<std::uint32_t>(offset),
                             static_cast<std::uint32_t>(outbox.bytes.size() - offset)});
}

void send_body(ConnectionId connection, ServerMessageType type, std::string_view body, Outbox& outbox) {
  send_body(connection, type, std::as_bytes(std::span(body)), outbox);
}

void ClientRequests::handle(Client& client, std::span<const std::byte> message, Stamp now, double received_s,
                            Outbox& outbox) {
  now_ = now;
  received_s_ = received_s;
  outbox_ = &outbox;
  const char* const refusal =
      std::visit([&](const auto& request) { return handle(client, request); }, read_client_message(message));
  if (refusal == nullptr) return;
  ++refused_;
  outbox.closes.push_back({client.connection, CloseCode::malformed, refusal});
}

const char* ClientRequests::acknowledge(Client& client, std::uint64_t ack) const noexcept {
  if (ack > client.last_update) return "ack: this frame was not sent";
  if (ack >= client.complete) client.acknowledged = std::max(client.acknowledged, ack);
  return nullptr;
}

const char* ClientRequests::handle(Client&, const Malformed& message) { return message.reason; }

const char* ClientRequests::handle(Client&, const Hello&) { return "hello: only as the first message"; }

const char* ClientRequests::handle(Client& client, const Input& message) {
  if (client.role != Role::play) return for_players;
  client.input.receive(message, received_s_);
  return acknowledge(client, message.ack);
}

const char* ClientRequests::handle(Client& client, const Ack& message) { return acknowledge(client, message.ack); }

const char* ClientRequests::handle(Client& client, const GetShape& message) {
  const ShapeDescription* const shape = world_.has_shape(message.shape) ? &world_.shape(message.shape) : nullptr;
  const std::size_t offset = outbox_->bytes.size();
  write_shape(message.shape, shape, outbox_->bytes);
  outbox_->messages.push_back({client.connection, Delivery::reliable, static_cast<std::uint32_t>(offset),
                               static_cast<std::uint32_t>(outbox_->bytes.size() - offset)});
  return nullptr;
}

const char* ClientRequests::handle(Client& client, const Application& message) {
  if (client.role != Role::play) return for_players;
  if (!hooks_.application) return "application: this world takes no such messages";
  hooks_.application(client.user, message.body);
  return nullptr;
}

const char* ClientRequests::handle(Client& client, const View& message) {
  if (client.role == Role::play) return for_spectators;
  client.view = message;
  return nullptr;
}

const char* ClientRequests::handle(Client& client, const Describe& message) {
  const bool may_see =
      client.role != Role::play || message.number == client.avatar.number() || client.known.contains(message.number);
  // A player may ask about an object that has just left its view.
  const std::string text =
      may_see ? described_text(world_, message.number) : "{\"number\":" + std::to_string(message.number) + "}";
  send_body(client.connection, ServerMessageType::described, text, *outbox_);
  return nullptr;
}

const char* ClientRequests::handle(Client& client, const Command& message) {
  if (client.role != Role::operate) return "command: only operators may send it";
  std::string outcome;
  switch (message.kind) {
    case Command::Kind::resize: {
      const Status status = world_.resize(message.value);
      outcome = status == Status::ok ? "the world changes to " + std::to_string(message.value) + " nodes"
                                     : std::string("refused: ") + name_of(status);
      break;
    }
    case Command::Kind::kill:
      outcome = kill(message.value);
      break;
    case Command::Kind::robots:
      outcome = hooks_.robots ? hooks_.robots(message.value) : "refused: this world has no robots";
      break;
  }
  send_body(client.connection, ServerMessageType::notice, outcome, *outbox_);
  return nullptr;
}

std::string ClientRequests::kill(std::uint32_t node) {
  if (world_.config().deadlines.node_ms == 0) {
    return "refused: without a deadline for nodes the world would wait for it";
  }
  const Status status = world_.inject({.node = NodeId(node), .frame = world_.frames(), .stage = NodeStage::gathering});
  return status == Status::ok ? "node " + std::to_string(node) + " stops in frame " + std::to_string(world_.frames())
                              : std::string("refused: ") + name_of(status);
}

}  // namespace ringfence::gateway
