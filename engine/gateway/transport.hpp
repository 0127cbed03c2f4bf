#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "ringfence/ids.hpp"

namespace ringfence::gateway {

/// Number of a connection; never used again.
using ConnectionId = std::uint64_t;

/// What a client may do. The values are those of the protocol.
enum class Role : std::uint8_t { play = 0, watch = 1, operate = 2 };

/// Why the gateway closes a connection; docs/client-protocol.md, "Close codes".
enum class CloseCode : std::uint16_t {
  going_away = 1001,
  text = 1003,
  too_big = 1009,
  malformed = 4400,
  unauthorised = 4401,
  forbidden = 4403,
  timeout = 4408,
  replaced = 4409,
  too_many = 4429,
  full = 4503,
};

/// Who a connection belongs to, as its hello and its path say.
struct Identity {
  Role role = Role::play;
  UserId user = no_user;  ///< of the token; no_user: a guest, or not a player
};

/// What happened to a connection. For one connection: opened, any number of messages, closed.
struct Event {
  enum class Kind : std::uint8_t {
    opened,   ///< its hello was accepted
    message,  ///< a message after the hello
    closed,   ///< by either side; its number is no longer valid
  };
  Kind kind = Kind::message;
  ConnectionId connection = 0;
  Identity identity;         ///< of `opened`
  std::uint32_t offset = 0;  ///< of `message`: its bytes in Inbox::bytes
  std::uint32_t size = 0;    ///< the same
  double received_s = 0;     ///< of `message`: time of a steady clock, seconds
};

/// Events in the order in which they happened, and the bytes of their messages.
struct Inbox {
  std::vector<Event> events;
  std::vector<std::byte> bytes;
  std::span<const std::byte> message(const Event& event) const noexcept {
    return std::span(bytes).subspan(event.offset, event.size);
  }
  void clear() noexcept {
    events.clear();
    bytes.clear();
  }
};

/// How a message to a client is delivered.
enum class Delivery : std::uint8_t {
  newest,    ///< an update: if an older one was not sent yet, this one replaces it; may be lost
  reliable,  ///< all are sent, in order; a client that has too many of them waiting is disconnected
};

/// Messages to clients, and connections to close.
struct Outbox {
  struct Message {
    ConnectionId connection = 0;
    Delivery delivery = Delivery::newest;
    std::uint32_t offset = 0, size = 0;  ///< of its bytes
  };
  struct Close {
    ConnectionId connection = 0;
    CloseCode code = CloseCode::going_away;
    std::string reason;
  };
  std::vector<Message> messages;
  std::vector<Close> closes;  ///< after the messages
  std::vector<std::byte> bytes;
  void clear() noexcept {
    messages.clear();
    closes.clear();
    bytes.clear();
  }
};

/// Carries messages between the gateway and its clients. The thread that runs the frames calls it; no call waits for a
/// client or a socket.
class Transport {
 public:
  virtual ~Transport() = default;
  /// Replaces the contents of `inbox` by what happened since the last call.
  virtual void receive(Inbox& inbox) = 0;
  /// Sends messages and closes connections; empties `outbox`. Connections that are closed already are ignored.
  virtual void send(Outbox& outbox) = 0;
  /// The text that /metrics returns from now on, in the Prometheus text format.
  virtual void set_metrics(std::string_view text) = 0;
};

}  // namespace ringfence::gateway
