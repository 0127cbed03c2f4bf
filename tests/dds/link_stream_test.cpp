#include "dds/link_stream.hpp"

#include <algorithm>
#include <array>
#include <cstring>
#include <random>
#include <vector>

#include <doctest/doctest.h>
#include <fcntl.h>
#include <signal.h>
#include <sys/mman.h>
#include <sys/wait.h>
#include <unistd.h>

#include "dds/link_events.hpp"
#include "dds/link_listener.hpp"
#include "dds/parcel_channel.hpp"

namespace ringfence::test {
namespace {

using Bytes = std::vector<std::byte>;
using dds::LinkStream;
using dds::SharedRings;

struct Pair {
  explicit Pair(LinkKind kind) {
    const LinkListener listener(kind);
    opener = listener.connect();
    acceptor = listener.accept();
  }
  LinkStream opener, acceptor;
};

Bytes random_bytes(std::mt19937_64& random, std::size_t size) {
  Bytes bytes(size);
  for (std::byte& byte : bytes) byte = static_cast<std::byte>(random());
  return bytes;
}

/// Takes up to `most` bytes of what has arrived.
void take_some(LinkStream& stream, Bytes& into, std::size_t most) {
  stream.note_events();
  stream.receive(1 << 16);
  const auto received = stream.received().first(std::min(most, stream.received().size()));
  into.insert(into.end(), received.begin(), received.end());
  stream.take(received.size());
  stream.release();
}

TEST_CASE("bytes in both directions arrive complete and in order, whatever carries them and however many are taken") {
  for (const LinkKind kind : link_kinds) {
    const std::uint64_t seed = 17 + static_cast<std::uint64_t>(kind);
    CAPTURE(seed);
    std::mt19937_64 random(seed);
    Pair pair(kind);
    std::array<LinkStream*, 2> ends{&pair.opener, &pair.acceptor};
    std::array<Bytes, 2> sent, received;  // by the sender
    constexpr std::size_t total = std::size_t{3} << 20;
    const auto step = [&] {
      for (std::size_t from = 0; from < 2; ++from) {
        if (sent[from].size() < total && ends[from]->unsent() < 300'000) {
          const Bytes bytes = random_bytes(random, 8 + random() % 5000 * 8);
          ends[from]->append(bytes);
          sent[from].insert(sent[from].end(), bytes.begin(), bytes.end());
        }
        if (random() % 3 == 0) ends[from]->flush();
        take_some(*ends[1 - from], received[from], random() % 30'000 / 8 * 8);
      }
    };
    const auto is_done = [&](std::size_t from) { return sent[from].size() >= total && received[from] == sent[from]; };
    for (int i = 0; i < 200'000 && !(is_done(0) && is_done(1)); ++i) step();
    CHECK(received[0] == sent[0]);
    CHECK(received[1] == sent[1]);
    CHECK(pair.opener.is_shared() == (kind == LinkKind::shared));
    CHECK(pair.acceptor.is_shared() == (kind == LinkKind::shared));
  }
}

TEST_CASE("a process that cannot map the memory receives everything over the socket") {
  const LinkListener listener(LinkKind::shared);
  LinkStream opener = listener.connect();
  REQUIRE(opener.is_shared());
  std::mt19937_64 random(3);
  Bytes sent = random_bytes(random, 200'000);  // more than the ring takes
  opener.append(sent);
  opener.flush();
  // The acceptor of this test reads the offer, and refuses it.
  dds::LinkSocket socket = listener.accept_socket();
  int descriptor = -1;
  REQUIRE(wait_until([&] { return socket.receive_descriptor(descriptor) == dds::LinkSocket::Result::done; }));
  REQUIRE(descriptor >= 0);
  close(descriptor);
  const std::byte refused{0};
  std::size_t count = 0;
  REQUIRE(socket.send({&refused, 1}, count) == dds::LinkSocket::Result::done);
  LinkStream acceptor(std::move(socket));
  Bytes received;
  CHECK(wait_until([&] {
    opener.note_events();
    opener.receive(64);
    opener.flush();
    take_some(acceptor, received, 1 << 16);
    return received.size() >= sent.size();
  }));
  CHECK(received == sent);
  CHECK_FALSE(opener.is_shared());
}

TEST_CASE("a reader that has requested it is woken by bytes, by room and by the end of the other process") {
  Pair pair(LinkKind::shared);
  const Bytes bytes(1000, std::byte{1});
  Bytes nothing;
  take_some(pair.acceptor, nothing, 8);  // maps the memory
  REQUIRE(pair.acceptor.is_shared());
  const dds::LinkEvents events;
  pair.acceptor.report_to(events, 1);
  const auto has_event = [&] { return events.take([](std::uint64_t) {}); };
  has_event();
  pair.opener.append(bytes);
  pair.opener.flush();
  CHECK_FALSE(has_event());          // not requested
  CHECK_FALSE(pair.acceptor.arm());  // there is something already
  Bytes received;
  take_some(pair.acceptor, received, bytes.size());
  CHECK(received == bytes);
  CHECK(pair.acceptor.arm());
  CHECK_FALSE(has_event());
  pair.opener.append(bytes);
  pair.opener.flush();
  CHECK(has_event());
  pair.opener.append(bytes);
  pair.opener.flush();
  CHECK_FALSE(has_event());  // once for each request

  Bytes many(1 << 18, std::byte{2});
  pair.acceptor.append(many);  // more than the ring takes
  CHECK_FALSE(pair.acceptor.flush());
  take_some(pair.acceptor, received, 1 << 16);
  CHECK(pair.acceptor.arm());
  has_event();
  take_some(pair.opener, received, 1 << 12);
  CHECK(has_event());
  pair.acceptor.disarm();
  pair.opener = {};
  CHECK(has_event());
  take_some(pair.acceptor, received, 8);
  CHECK(pair.acceptor.is_closed());
}

TEST_CASE("a sender that is killed at any moment leaves whole parcels, and the reader sees the end") {
  for (int round = 0; round < 8; ++round) {
    const LinkListener listener(LinkKind::shared);
    const pid_t child = fork();
    REQUIRE(child >= 0);
    if (child == 0) {
      dds::ParcelChannel channel(listener.connect());
      const Bytes message(5000, std::byte{7});
      for (;;) {
        if (channel.has_room()) channel.add(message);
      }
    }
    dds::ParcelChannel channel(listener.accept());
    std::size_t messages = 0, wrong = 0;
    auto deliver = [&](dds::ParcelKind, std::uint32_t, std::size_t& offset, std::span<const std::byte> contents) {
      return dds::for_each_message(contents, offset, [&](std::span<const std::byte> message) {
        ++messages;
        wrong += message.size() != 5000 ||
                 std::any_of(message.begin(), message.end(), [](std::byte byte) { return byte != std::byte{7}; });
        return true;
      });
    };
    const std::size_t until = 1 + static_cast<std::size_t>(round) * 37;
    CHECK(wait_until([&] {
      channel.note_events();
      channel.receive(deliver);
      return messages >= until;
    }));
    kill(child, SIGKILL);
    waitpid(child, nullptr, 0);
    CHECK(wait_until([&] {
      channel.note_events();
      channel.receive(deliver);
      return channel.is_broken();
    }));
    CHECK(wrong == 0);
  }
}

/// A memory file with the layout that SharedRings::create makes.
struct Memory {
  explicit Memory(std::size_t first = 1 << 16, std::size_t second = 1 << 17)
      : rings(SharedRings::create(first, second)) {
    REQUIRE(rings != nullptr);
    file = dup(rings->descriptor());
    size = static_cast<std::size_t>(lseek(file, 0, SEEK_END));
    bytes = static_cast<std::byte*>(mmap(nullptr, size, PROT_READ | PROT_WRITE, MAP_SHARED, file, 0));
    REQUIRE(bytes != MAP_FAILED);
  }
  ~Memory() {
    munmap(bytes, size);
    close(file);
  }
  std::unique_ptr<SharedRings> rings;
  int file = -1;
  std::size_t size = 0;
  std::byte* bytes = nullptr;
};

TEST_CASE("only memory with possible sizes, which cannot shrink, is opened") {
  Memory memory;
  CHECK(SharedRings::open(memory.file) != nullptr);
  CHECK(ftruncate(memory.file, 4096) != 0);
  CHECK(SharedRings::open(-1) == nullptr);
  const std::array<std::uint64_t, 7> sizes{0, 8, 1 << 15, 100'000, std::uint64_t{1} << 40, ~std::uint64_t{0}, 1 << 18};
  for (const std::size_t field : {std::size_t{8}, std::size_t{16}}) {
    std::uint64_t before = 0;
    std::memcpy(&before, memory.bytes + field, 8);
    for (const std::uint64_t size : sizes) {
      std::memcpy(memory.bytes + field, &size, 8);
      CHECK(SharedRings::open(memory.file) == nullptr);
    }
    std::memcpy(memory.bytes + field, &before, 8);
  }
  memory.bytes[0] ^= std::byte{1};  // of the magic number
  CHECK(SharedRings::open(memory.file) == nullptr);

  int pipe_ends[2];
  REQUIRE(pipe(pipe_ends) == 0);
  CHECK(SharedRings::open(pipe_ends[0]) == nullptr);
  const int unsealed = memfd_create("ringfence-test", MFD_CLOEXEC | MFD_ALLOW_SEALING);
  REQUIRE(write(unsealed, memory.bytes, memory.size) == static_cast<ssize_t>(memory.size));
  CHECK(SharedRings::open(unsealed) == nullptr);
  for (const int file : {pipe_ends[0], pipe_ends[1], unsealed}) close(file);
}

TEST_CASE("whatever the other process writes to the memory, nothing outside of it is read or written") {
  const std::uint64_t seed = 99;
  CAPTURE(seed);
  std::mt19937_64 random(seed);
  std::size_t broken = 0, delivered = 0;
  for (int round = 0; round < 400; ++round) {
    Memory memory;
    const auto rings = SharedRings::open(memory.file);
    REQUIRE(rings != nullptr);
    SharedRings::End& end = rings->end();
    std::memset(memory.bytes + memory.size - (1 << 16) - (1 << 17), 1, (1 << 16) + (1 << 17));  // both rings
    for (int step = 0; step < 20 && !end.is_broken(); ++step) {
      // Random words, sometimes near the positions of a stream that is in order.
      for (int i = 0; i < 8; ++i) {
        const std::size_t at = 128 + random() % 120 * 8;
        const std::uint64_t word = random() >> (random() % 64);
        std::memcpy(memory.bytes + at, &word, 8);
      }
      (void)end.make_room(random() % (1 << 17));
      CHECK(end.room() <= 1 << 17);
      std::memset(rings->out_at(end.write_position()), 1, end.room());
      end.stage(end.room() / 8 * 8 / 2 / 8 * 8);
      (void)end.publish();
      end.refresh();
      CHECK(end.available() <= 1 << 16);
      const std::span<const std::byte> received{rings->in_at(end.read_position()), end.available()};
      delivered +=
          static_cast<std::size_t>(std::count(received.begin(), received.end(), std::byte{1}));  // reads each byte
      end.take(end.available());
      (void)end.release();
      (void)end.arm(true);
      end.disarm();
    }
    broken += end.is_broken() ? 1 : 0;
  }
  CHECK(broken > 100);
  CHECK(delivered > 0);
}

}  // namespace
}  // namespace ringfence::test
