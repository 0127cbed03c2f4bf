#pragma once

#include <deque>
#include <map>
#include <string>
#include <utility>
#include <vector>

#include "gateway/protocol/client_messages.hpp"
#include "gateway/protocol/server_messages.hpp"
#include "gateway/transport.hpp"

namespace ringfence::gateway {

/// A transport without a network, which a test reads and writes.
class FakeTransport final : public Transport {
 public:
  struct Closed {
    CloseCode code{};
    std::string reason;
  };

  ConnectionId open(Role role, UserId user = no_user) {
    Event event;
    event.kind = Event::Kind::opened;
    event.connection = ++last_;
    event.identity = {role, user};
    events_.events.push_back(event);
    return last_;
  }
  template <class Message>
  void client_sends(ConnectionId connection, const Message& message) {
    std::vector<std::byte> bytes;
    write(message, bytes);
    client_sends_bytes(connection, bytes);
  }
  void client_sends_bytes(ConnectionId connection, const std::vector<std::byte>& bytes) {
    Event event;
    event.connection = connection;
    event.offset = static_cast<std::uint32_t>(events_.bytes.size());
    event.size = static_cast<std::uint32_t>(bytes.size());
    events_.bytes.insert(events_.bytes.end(), bytes.begin(), bytes.end());
    events_.events.push_back(event);
  }
  void client_closes(ConnectionId connection) {
    Event event;
    event.kind = Event::Kind::closed;
    event.connection = connection;
    events_.events.push_back(event);
  }
  /// The messages of a type to a connection since the last call, oldest first.
  std::vector<std::vector<std::byte>> take(ConnectionId connection, ServerMessageType type) {
    std::vector<std::vector<std::byte>> taken;
    std::erase_if(sent_[connection], [&](const std::vector<std::byte>& message) {
      if (type_of(message) != type) return false;
      taken.push_back(message);
      return true;
    });
    return taken;
  }
  /// Null unless the gateway closed the connection.
  const Closed* closed(ConnectionId connection) const {
    const auto found = closed_.find(connection);
    return found == closed_.end() ? nullptr : &found->second;
  }

  void receive(Inbox& inbox) override { inbox = std::exchange(events_, {}); }
  void send(Outbox& outbox) override {
    for (const Outbox::Message& message : outbox.messages) {
      const auto begin = outbox.bytes.begin() + message.offset;
      sent_[message.connection].emplace_back(begin, begin + message.size);
    }
    for (const Outbox::Close& close : outbox.closes) closed_[close.connection] = {close.code, close.reason};
    outbox.clear();
  }
  void set_metrics(std::string_view) override {}

 private:
  ConnectionId last_ = 0;
  Inbox events_;
  std::map<ConnectionId, std::vector<std::vector<std::byte>>> sent_;
  std::map<ConnectionId, Closed> closed_;
};

}  // namespace ringfence::gateway
