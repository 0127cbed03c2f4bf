#include "link/channel.hpp"

#include <cstring>
#include <thread>
#include <vector>

#include <doctest/doctest.h>

#include "ringfence/error.hpp"

namespace ringfence::link {
namespace {

TEST_CASE("messages arrive whole and in order through a small ring, both sides sleeping") {
  Doorbell sender_bell, receiver_bell;
  Channel channel(4096, &receiver_bell, &sender_bell);
  constexpr int count = 100000;
  std::thread producer([&] {
    Sender& sender = channel.sender();
    for (int i = 0; i < count; ++i) {
      const std::size_t size = 4 + static_cast<std::size_t>(i * 7919) % 2000;
      std::span<std::byte> room;
      sender_bell.wait([&] { return !(room = sender.claim(size)).empty(); });
      std::memcpy(room.data(), &i, sizeof i);
      std::memset(room.data() + 4, i & 255, size - 4);
      sender.commit(size);
      if (i % 5 == 0) sender.publish();
    }
    sender.close();
  });
  Receiver& receiver = channel.receiver();
  int seen = 0, wrong = 0;
  for (;;) {
    if (!receiver.has_message()) {
      receiver.release();
      receiver_bell.wait([&] { return receiver.has_message() || receiver.closed(); });
    }
    const auto message = receiver.next();
    if (message.empty()) break;
    int number;
    std::memcpy(&number, message.data(), sizeof number);
    wrong += number != seen || message.size() != 4 + static_cast<std::size_t>(seen * 7919) % 2000;
    for (std::size_t i = 4; i < message.size(); ++i) wrong += message[i] != std::byte(seen & 255);
    ++seen;
    if (seen % 3 == 0) receiver.release();
  }
  producer.join();
  CHECK(seen == count);
  CHECK(wrong == 0);
}

}  // namespace
}  // namespace ringfence::link
