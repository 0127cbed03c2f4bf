#pragma once

#include <cstddef>
#include <cstring>
#include <functional>
#include <span>
#include <vector>

#include "link/channel.hpp"
#include "messages/header.hpp"

namespace ringfence::nodes::test {

using messages::Endpoint;
using messages::MessageType;

/// A recorded message.
struct LoggedMessage {
  Endpoint from, to;
  messages::Header header;
  std::vector<std::byte> bytes;  ///< header included
  MessageType type() const { return static_cast<MessageType>(header.type); }
  template <class Record>
  Record record(std::size_t i) const {
    Record record;
    std::memcpy(&record, bytes.data() + sizeof(messages::Header) + i * header.record_bytes, sizeof record);
    return record;
  }
};

/// A channel in two halves: the test sees every message and decides what is delivered.
class TappedChannel {
 public:
  TappedChannel(std::size_t ring_bytes, std::size_t delivery_bytes, Endpoint from, Endpoint to)
      : from_(from), to_(to), near_(ring_bytes, nullptr, nullptr), far_(delivery_bytes, nullptr, nullptr) {}
  link::Sender& sender() { return near_.sender(); }
  link::Receiver& receiver() { return far_.receiver(); }
  unsigned period = 1;  ///< in random order it passes a message once in this many rounds
  /// Takes up to `most` messages that were sent, lets `tamper` replace them, delivers the result and records it in
  /// `log`.
  using Tamper = std::function<void(const LoggedMessage& message, std::vector<std::vector<std::byte>>& instead)>;
  bool pass(const Tamper& tamper, std::vector<LoggedMessage>& log, std::size_t most = ~std::size_t{0});
  /// Delivers a message that no role sent.
  void forge(std::span<const std::byte> message);

 private:
  Endpoint from_, to_;
  link::Channel near_, far_;
};

}  // namespace ringfence::nodes::test
