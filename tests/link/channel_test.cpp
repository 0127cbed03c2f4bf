#include "link/channel.hpp"

#include <algorithm>
#include <cstring>
#include <deque>
#include <random>
#include <string>
#include <thread>
#include <vector>

#include <doctest/doctest.h>

#include "ringfence/error.hpp"

namespace ringfence::link {
namespace {

TEST_CASE("messages arrive complete and in order through a small ring while both sides sleep") {
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

TEST_CASE("a ring of an invalid size is refused, and the message names the option") {
  for (const std::size_t bytes : {std::size_t{0}, std::size_t{2048}, std::size_t{5000}, std::size_t{1} << 32}) {
    CAPTURE(bytes);
    CHECK_THROWS_WITH_AS(Channel(bytes, nullptr, nullptr, "--server-ring"),
                         doctest::Contains(("--server-ring is " + std::to_string(bytes)).c_str()), Error);
  }
  CHECK_NOTHROW(Channel(4096, nullptr, nullptr));
}

TEST_CASE("one thread can use both ends, and a message is not visible before it is published") {
  Doorbell bell;
  Channel channel(4096, &bell, &bell);
  Sender& sender = channel.sender();
  Receiver& receiver = channel.receiver();
  CHECK(receiver.next().empty());
  auto room = sender.claim(100);
  REQUIRE(room.size() == 100);
  CHECK(reinterpret_cast<std::uintptr_t>(room.data()) % 64 == 0);
  std::memset(room.data(), 7, 100);
  sender.commit(33);
  CHECK_FALSE(receiver.has_message());
  sender.publish();
  const auto message = receiver.next();
  REQUIRE(message.size() == 33);
  CHECK(message[32] == std::byte{7});
  CHECK(receiver.next().empty());
  receiver.release();
}

TEST_CASE("a claim that is cancelled or replaced has no effect") {
  Channel channel(4096, nullptr, nullptr);
  REQUIRE_FALSE(channel.sender().claim(500).empty());
  channel.sender().commit(0);
  channel.sender().publish();
  CHECK(channel.receiver().next().empty());
  REQUIRE_FALSE(channel.sender().claim(500).empty());
  const auto room = channel.sender().claim(8);
  std::memset(room.data(), 1, 8);
  channel.sender().commit(8);
  channel.sender().publish();
  CHECK(channel.receiver().next().size() == 8);
  CHECK(channel.receiver().next().empty());
}

TEST_CASE("a message of the largest size fits at any position of the ring once everything is released") {
  for (const std::size_t bytes : {4096, 8192, 131072, 1048576}) {
    Channel channel(bytes, nullptr, nullptr);
    Sender& sender = channel.sender();
    const std::size_t largest = sender.largest_message();
    CHECK(largest == std::min<std::size_t>(bytes / 2, 65536));
    for (std::size_t step = 8; step < 2 * bytes; step += 8 + bytes / 256) {
      // A small message of varying size is sent first, so that the large one starts at many positions.
      REQUIRE_FALSE(sender.claim(step % 2000 + 1).empty());
      sender.commit(step % 2000 + 1);
      sender.publish();
      REQUIRE_FALSE(channel.receiver().next().empty());
      channel.receiver().release();
      const auto room = sender.claim(largest);
      REQUIRE(room.size() == largest);
      std::memset(room.data(), static_cast<int>(step), largest);
      sender.commit(largest);
      sender.publish();
      const auto message = channel.receiver().next();
      REQUIRE(message.size() == largest);
      CHECK(message.front() == std::byte(step));
      CHECK(message.back() == std::byte(step));
      channel.receiver().release();
    }
  }
}

TEST_CASE("a sender that finds no room publishes, and the next release rings it") {
  Doorbell senders, receivers;
  Channel channel(4096, &receivers, &senders);
  int sent = 0;
  while (!channel.sender().claim(1000).empty()) channel.sender().commit(1000), ++sent;
  CHECK(sent == 4);
  CHECK(channel.sender().staged() == 0);
  for (int i = 0; i < sent; ++i) CHECK(channel.receiver().next().size() == 1000);
  CHECK(channel.sender().claim(1000).empty());
  channel.receiver().release();
  CHECK(channel.sender().claim(1000).size() == 1000);
}

TEST_CASE("what a quiet sender has published wakes the receiver when the sender asks for it") {
  Doorbell bell;
  Channel channel(4096, &bell, nullptr);
  channel.sender().set_quiet(true);
  for (int round = 0; round < 20; ++round) {
    std::thread receiver([&] {
      bell.wait([&] { return channel.receiver().has_message(); });
      CHECK(channel.receiver().next().size() == 8);
      channel.receiver().release();
    });
    channel.sender().claim(8);
    channel.sender().commit(8);
    channel.sender().publish();
    channel.sender().ring_unrung();
    CHECK(!channel.sender().take_unrung());
    receiver.join();
  }
}

TEST_CASE("random claims, lengths, publications and releases arrive as they were sent, with and without a stage") {
  for (const std::size_t bytes : {std::size_t{4096}, std::size_t{1} << 17}) {
    for (std::uint32_t seed = 1; seed <= 20; ++seed) {
      CAPTURE(bytes);
      CAPTURE(seed);
      std::mt19937 random(seed);
      const std::size_t largest = std::min<std::size_t>(bytes / 2, 6000);
      Channel channel(bytes, nullptr, nullptr);
      std::deque<std::vector<std::byte>> expected;
      std::size_t published = 0, wrong = 0, received = 0, size = 8;
      const auto publish = [&] { channel.sender().publish(), published = expected.size(); };
      const auto receive = [&] {
        const auto peeked = channel.receiver().peek();
        const auto message = channel.receiver().next();
        CHECK(message.empty() == (published == 0));
        wrong += peeked.data() != message.data() || peeked.size() != message.size();
        if (message.empty()) return;
        wrong += !std::equal(message.begin(), message.end(), expected.front().begin(), expected.front().end());
        expected.pop_front(), --published, ++received;
      };
      for (int step = 0; step < 20000; ++step) {
        // A size is kept for a while, so that there are runs; some are larger than what is staged.
        if (random() % 8 == 0) size = 1 + random() % (random() % 4 == 0 ? largest : 100);
        const auto room = channel.sender().claim(size);
        if (room.empty()) {
          published = expected.size();
          for (std::size_t i = 0; i < 1 + expected.size() / 2; ++i) receive();
          channel.receiver().release();
          continue;
        }
        wrong += room.size() != size || reinterpret_cast<std::uintptr_t>(room.data()) % 8 != 0;
        const std::size_t used = random() % 16 == 0 ? random() % (size + 1) : size;
        std::vector<std::byte> content(used);
        for (std::byte& byte : content) byte = static_cast<std::byte>(random());
        std::copy(content.begin(), content.end(), room.begin());
        channel.sender().commit(used);
        if (used != 0) expected.push_back(content);
        if (random() % 10 == 0) publish();
        if (random() % 3 == 0) receive();
        if (random() % 20 == 0) channel.receiver().release();
      }
      publish();
      while (!expected.empty()) receive();
      CHECK(wrong == 0);
      CHECK(received > 1000);
      CHECK(channel.receiver().next().empty());
    }
  }
}

TEST_CASE("messages of one length that are published together follow each other without a gap") {
  Channel channel(std::size_t{1} << 17, nullptr, nullptr);
  for (int batch = 0; batch < 3; ++batch) {
    for (int i = 0; i < 20; ++i) {
      std::ranges::fill(channel.sender().claim(64), std::byte(i));
      channel.sender().commit(64);
    }
    channel.sender().publish();
    channel.receiver().next();
    const std::byte* before = channel.receiver().next().data();
    for (int i = 2; i < 20; ++i) {
      const auto message = channel.receiver().next();
      CHECK(message.data() == before + 64);
      CHECK(message.front() == std::byte(i));
      before = message.data();
    }
    channel.receiver().release();
  }
}

TEST_CASE("the other end sees the close after the last message") {
  Channel channel(4096, nullptr, nullptr);
  REQUIRE_FALSE(channel.sender().claim(8).empty());
  channel.sender().commit(8);
  channel.sender().close();
  CHECK_FALSE(channel.receiver().closed());
  CHECK(channel.receiver().next().size() == 8);
  CHECK(channel.receiver().next().empty());
  CHECK(channel.receiver().closed());
  CHECK_FALSE(channel.sender().closed());
  channel.receiver().release();
  channel.receiver().close();
  CHECK(channel.sender().closed());
}

}  // namespace
}  // namespace ringfence::link
