// A parcel channel between two processes delivers the same bytes in the same order as a ring.
#include <chrono>
#include <cstring>
#include <deque>
#include <random>
#include <string>
#include <vector>

#include <doctest/doctest.h>
#include <spawn.h>
#include <sys/wait.h>
#include <unistd.h>

#include "dds/channel_end.hpp"

namespace ringfence {
namespace {

using Bytes = std::vector<std::byte>;

class Echo {
 public:
  Echo(std::uint32_t domain, int pause_ms) {
    std::string arguments_text[] = {RINGFENCE_ECHO, std::to_string(domain), std::to_string(pause_ms)};
    char* arguments[] = {arguments_text[0].data(), arguments_text[1].data(), arguments_text[2].data(), nullptr};
    REQUIRE(posix_spawn(&process_, RINGFENCE_ECHO, nullptr, nullptr, arguments, environ) == 0);
  }
  ~Echo() {
    kill(process_, SIGKILL);
    waitpid(process_, nullptr, 0);
  }
  Echo(const Echo&) = delete;
  Echo& operator=(const Echo&) = delete;

 private:
  pid_t process_ = 0;
};

Bytes random_message(std::mt19937_64& random, std::size_t largest) {
  // Many small messages, some as large as a ring of 64 KiB takes, and sizes around multiples of 8.
  const std::size_t kind = random() % 8;
  const std::size_t size = kind == 0 ? largest - random() % 9 : kind < 3 ? 1 + random() % largest : 1 + random() % 200;
  Bytes message(std::clamp<std::size_t>(size, 2, largest));
  for (std::byte& byte : message) {
    byte = static_cast<std::byte>(random());
  }
  return message;
}

/// The messages as a ring delivers them.
std::deque<Bytes> through_ring(const std::vector<Bytes>& messages) {
  link::Channel channel(std::size_t{1} << 16, nullptr, nullptr);
  std::deque<Bytes> received;
  const auto receive = [&] {
    for (auto message = channel.receiver().next(); !message.empty(); message = channel.receiver().next()) {
      received.emplace_back(message.begin(), message.end());
    }
    channel.receiver().release();
  };
  for (const Bytes& message : messages) {
    auto room = channel.sender().claim(message.size());
    while (room.empty()) {
      receive();
      room = channel.sender().claim(message.size());
    }
    std::copy(message.begin(), message.end(), room.begin());
    channel.sender().commit(message.size());
  }
  channel.sender().publish();
  receive();
  return received;
}

void check_same_bytes(int pause_ms, std::size_t count, std::uint64_t seed) {
  dds::NetworkConfig network;
  network.domain = dds::NetworkConfig::any_domain;
  network.interface = "lo";
  test::ChannelEnd side(network, dds::Side::world, dds::Topic::down, dds::Topic::up, 7);
  const Echo echo(side.domain(), pause_ms);
  const auto end = std::chrono::steady_clock::now() + std::chrono::seconds(30);
  const auto in_time = [&] { return std::chrono::steady_clock::now() < end; };
  while (!side.is_matched() && in_time()) {
    usleep(1000);
  }
  REQUIRE(side.is_matched());

  std::mt19937_64 random(seed);
  std::vector<Bytes> messages;
  for (std::size_t i = 0; i < count; ++i) {
    messages.push_back(random_message(random, side.out().largest_message()));
  }
  messages.push_back({test::end_marker});
  std::deque<Bytes> expected = through_ring(messages);
  REQUIRE(expected.size() == messages.size());

  std::size_t sent = 0;
  std::size_t received = 0;
  bool same = true;
  std::uint64_t max_in_flight = 0;
  while (received < messages.size() && same && in_time() && !side.broken()) {
    while (sent < messages.size()) {
      const auto room = side.out().claim(messages[sent].size());
      if (room.empty()) {
        break;
      }
      std::copy(messages[sent].begin(), messages[sent].end(), room.begin());
      side.out().commit(messages[sent++].size());
    }
    side.out().publish();
    side.step();
    for (auto message = side.in().next(); !message.empty() && same; message = side.in().next()) {
      same = std::equal(message.begin(), message.end(), expected.front().begin(), expected.front().end());
      expected.pop_front();
      ++received;
    }
    side.in().release();
    max_in_flight = std::max(max_in_flight, side.parcel_channel().counters().sent_parcels);
  }
  CHECK_MESSAGE(same, "seed " << seed << ", message " << received);
  CHECK_MESSAGE(received == messages.size(), "seed " << seed);
  CHECK_FALSE(side.broken());
  // Messages were collected: fewer parcels than messages.
  CHECK(side.parcel_channel().counters().sent_parcels < messages.size());
}

}  // namespace

TEST_CASE("a message has the same bytes over the network as over a ring") { check_same_bytes(0, 4000, 1); }

TEST_CASE("a slow receiver fills the channel, which fills the ring: nothing is lost and the order stays") {
  check_same_bytes(3, 1500, 2);
}

TEST_CASE("a full channel accepts no parcel beyond its window, and refuses without waiting") {
  dds::NetworkConfig network;
  network.domain = dds::NetworkConfig::any_domain;
  network.interface = "lo";
  // There is no receiver, so nothing is ever acknowledged.
  test::ChannelEnd side(network, dds::Side::world, dds::Topic::down, dds::Topic::up, 7);
  const Bytes message(30'000, std::byte{1});
  std::size_t sent = 0;
  for (int turn = 0; turn < 1000; ++turn) {
    for (auto room = side.out().claim(message.size()); !room.empty(); room = side.out().claim(message.size())) {
      std::copy(message.begin(), message.end(), room.begin());
      side.out().commit(message.size());
      ++sent;
    }
    side.out().publish();
    const auto begin = std::chrono::steady_clock::now();
    side.step();
    CHECK(std::chrono::steady_clock::now() - begin < std::chrono::seconds(1));
  }
  CHECK(side.parcel_channel().counters().sent_parcels == dds::ParcelChannel::window);
  CHECK(side.parcel_channel().counters().refused_writes > 0);
  // One or two messages per parcel in the window, one being collected, two in the ring.
  CHECK(sent <= 2 * dds::ParcelChannel::window + 4);
}

}  // namespace ringfence
