#include "dds/parcel_channel.hpp"

// A parcel channel between two processes delivers the same bytes in the same order as a ring, over TCP, over a local
// socket and through shared memory.
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
#include "dds/link_listener.hpp"
#include "node_world.hpp"

namespace ringfence {
namespace {

using Bytes = std::vector<std::byte>;

class Echo {
 public:
  Echo(const test::LinkListener& at, int pause_ms) {
    std::string arguments_text[] = {RINGFENCE_ECHO, std::to_string(at.port()), std::to_string(at.name()),
                                    at.kind() == test::LinkKind::shared ? "1" : "0", std::to_string(pause_ms)};
    char* arguments[] = {arguments_text[0].data(), arguments_text[1].data(), arguments_text[2].data(),
                         arguments_text[3].data(), arguments_text[4].data(), nullptr};
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

void check_same_bytes(test::LinkKind kind, int pause_ms, std::size_t count, std::uint64_t seed) {
  const test::LinkListener listener(kind);
  const Echo echo(listener, pause_ms);
  test::ChannelEnd side(listener.accept());
  const auto end = std::chrono::steady_clock::now() + std::chrono::seconds(30);
  const auto in_time = [&] { return std::chrono::steady_clock::now() < end; };

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
  while (received < messages.size() && same && in_time()) {
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
  }
  CHECK_MESSAGE(same, "seed " << seed << ", message " << received);
  CHECK_MESSAGE(received == messages.size(), "seed " << seed);
  // Messages were collected: fewer parcels than messages.
  const dds::ParcelChannel::Counters counters = side.parcel_channel().counters();
  CHECK(counters.sent_parcels < messages.size());
  CHECK(counters.shared_bytes == (kind == test::LinkKind::shared ? counters.sent_bytes : 0));
}

}  // namespace

TEST_CASE("a message has the same bytes over the network as over a ring") {
  for (const test::LinkKind kind : test::link_kinds) check_same_bytes(kind, 0, 4000, 1);
}

TEST_CASE("a slow receiver fills the channel, which fills the ring: nothing is lost and the order stays") {
  for (const test::LinkKind kind : test::link_kinds) check_same_bytes(kind, 3, 1000, 2);
}

TEST_CASE("a full channel takes a bounded number of messages, and refuses without waiting") {
  for (const test::LinkKind kind : test::link_kinds) {
    // The other end reads nothing.
    const test::LinkListener listener(kind);
    test::ChannelEnd side(listener.connect());
    const dds::LinkStream other = listener.accept();
    const Bytes message(30'000, std::byte{1});
    constexpr std::size_t turns = 4000;
    std::size_t sent = 0;
    for (std::size_t turn = 0; turn < turns; ++turn) {
      for (auto room = side.out().claim(message.size()); !room.empty(); room = side.out().claim(message.size())) {
        std::copy(message.begin(), message.end(), room.begin());
        side.out().commit(message.size());
        ++sent;
      }
      side.out().publish();
      side.step();
    }
    CHECK(side.parcel_channel().counters().refused_writes > turns / 2);
    CHECK(side.parcel_channel().has_unsent());
    CHECK(sent < turns / 2);  // what the buffers of the system take
  }
}

TEST_CASE("a channel whose other end closes, or sends an invalid header, is broken after what was sent before") {
  for (const test::LinkKind kind : test::link_kinds) {
    for (const bool is_invalid : {false, true}) {
      const test::LinkListener listener(kind);
      dds::LinkStream theirs = listener.connect();
      test::ChannelEnd mine(listener.accept());
      struct {
        dds::ParcelHeader header{16, static_cast<std::uint32_t>(dds::ParcelKind::messages), 0, 0};
        dds::Packing packing{3, 0};
        char text[8] = "abc";
      } const parcel;
      std::vector<std::byte> bytes(sizeof parcel);
      std::memcpy(bytes.data(), &parcel, sizeof parcel);
      if (is_invalid) {
        const dds::ParcelHeader too_long{dds::ParcelChannel::max_bytes + 8, 0, 0, 0};
        const auto* const begin = reinterpret_cast<const std::byte*>(&too_long);
        bytes.insert(bytes.end(), begin, begin + sizeof too_long);
      }
      theirs.append(bytes);
      REQUIRE(test::wait_until([&] {
        mine.step();
        return theirs.flush();
      }));
      if (!is_invalid) theirs = {};
      CHECK(test::wait_until([&] {
        mine.step();
        return mine.parcel_channel().is_broken();
      }));
      const auto message = mine.in().next();
      REQUIRE(message.size() == 3);
      CHECK(std::memcmp(message.data(), "abc", 3) == 0);
      CHECK(mine.in().next().empty());
    }
  }
}

TEST_CASE("a channel whose other end closes is broken also while a parcel waits") {
  for (const test::LinkKind kind : test::link_kinds) {
    const test::LinkListener listener(kind);
    dds::LinkStream theirs = listener.connect();
    test::ChannelEnd mine(listener.accept());
    const dds::ParcelHeader parcel{0, static_cast<std::uint32_t>(dds::ParcelKind::assign), 0, 0};
    theirs.append(std::as_bytes(std::span(&parcel, 1)));
    REQUIRE(test::wait_until([&] {
      mine.step();
      return theirs.flush();
    }));
    dds::ParcelChannel& channel = mine.parcel_channel();
    bool waits = false;
    auto refuse = [&](dds::ParcelKind, std::uint32_t, std::size_t&, std::span<const std::byte>) {
      waits = true;
      return false;
    };
    const auto receive = [&] {
      channel.note_events();
      CHECK(!channel.receive(refuse));
    };
    CHECK(test::wait_until([&] {
      receive();
      return waits;
    }));
    CHECK(!channel.is_broken());
    theirs = {};
    CHECK(test::wait_until([&] {
      receive();
      return channel.is_broken();
    }));
  }
}

}  // namespace ringfence
