// The bytes of a message are those of a ring, in the same order, whatever the way between two processes makes of them.
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
    std::string words[] = {RINGFENCE_ECHO, std::to_string(domain), std::to_string(pause_ms)};
    char* arguments[] = {words[0].data(), words[1].data(), words[2].data(), nullptr};
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
  // Many small ones, some as large as a ring of 64 KiB takes, and sizes about multiples of 8.
  const std::size_t kind = random() % 8;
  const std::size_t size = kind == 0 ? largest - random() % 9 : kind < 3 ? 1 + random() % largest : 1 + random() % 200;
  Bytes message(std::clamp<std::size_t>(size, 2, largest));
  for (std::byte& byte : message) {
    byte = static_cast<std::byte>(random());
  }
  return message;
}

/// What a ring alone makes of the messages: the same sender's calls, heard at the other end.
std::deque<Bytes> through_ring(const std::vector<Bytes>& messages) {
  link::Channel channel(std::size_t{1} << 16, nullptr, nullptr);
  std::deque<Bytes> heard;
  const auto hear = [&] {
    for (auto message = channel.receiver().next(); !message.empty(); message = channel.receiver().next()) {
      heard.emplace_back(message.begin(), message.end());
    }
    channel.receiver().release();
  };
  for (const Bytes& message : messages) {
    auto room = channel.sender().claim(message.size());
    while (room.empty()) {
      hear();
      room = channel.sender().claim(message.size());
    }
    std::copy(message.begin(), message.end(), room.begin());
    channel.sender().commit(message.size());
  }
  channel.sender().publish();
  hear();
  return heard;
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

  std::size_t said = 0;
  std::size_t heard = 0;
  bool same = true;
  std::uint64_t most_on_the_way = 0;
  while (heard < messages.size() && same && in_time() && !side.broken()) {
    while (said < messages.size()) {
      const auto room = side.out().claim(messages[said].size());
      if (room.empty()) {
        break;
      }
      std::copy(messages[said].begin(), messages[said].end(), room.begin());
      side.out().commit(messages[said++].size());
    }
    side.out().publish();
    side.step();
    for (auto message = side.in().next(); !message.empty() && same; message = side.in().next()) {
      same = std::equal(message.begin(), message.end(), expected.front().begin(), expected.front().end());
      expected.pop_front();
      ++heard;
    }
    side.in().release();
    most_on_the_way = std::max(most_on_the_way, side.parcel_channel().counters().sent_parcels);
  }
  CHECK_MESSAGE(same, "seed " << seed << ", message " << heard);
  CHECK_MESSAGE(heard == messages.size(), "seed " << seed);
  CHECK_FALSE(side.broken());
  // Gathered: fewer parcels than messages.
  CHECK(side.parcel_channel().counters().sent_parcels < messages.size());
}

}  // namespace

TEST_CASE("a message has the same bytes over the network as over a ring") { check_same_bytes(0, 4000, 1); }

TEST_CASE("a slow receiver makes a full way, which is a full ring: nothing is lost and the order stays") {
  check_same_bytes(3, 1500, 2);
}

TEST_CASE("a full way takes no parcel more than its window, and refuses without waiting") {
  dds::NetworkConfig network;
  network.domain = dds::NetworkConfig::any_domain;
  network.interface = "lo";
  // Nobody answers, so nothing is ever taken.
  test::ChannelEnd side(network, dds::Side::world, dds::Topic::down, dds::Topic::up, 7);
  const Bytes message(30'000, std::byte{1});
  std::size_t said = 0;
  for (int turn = 0; turn < 1000; ++turn) {
    for (auto room = side.out().claim(message.size()); !room.empty(); room = side.out().claim(message.size())) {
      std::copy(message.begin(), message.end(), room.begin());
      side.out().commit(message.size());
      ++said;
    }
    side.out().publish();
    const auto begin = std::chrono::steady_clock::now();
    side.step();
    CHECK(std::chrono::steady_clock::now() - begin < std::chrono::seconds(1));
  }
  CHECK(side.parcel_channel().counters().sent_parcels == dds::ParcelChannel::window);
  CHECK(side.parcel_channel().counters().refused_writes > 0);
  // In the window one or two a parcel, one being gathered, two in the ring.
  CHECK(said <= 2 * dds::ParcelChannel::window + 4);
}

}  // namespace ringfence
