// The ring between two processes: the producer is killed at random, again and again, and another takes over.
#include <algorithm>
#include <atomic>
#include <cstring>
#include <new>
#include <random>

#include <doctest/doctest.h>
#include <signal.h>
#include <sys/mman.h>
#include <sys/prctl.h>
#include <sys/wait.h>
#include <unistd.h>

#include "link/channel.hpp"

namespace ringfence::link {
namespace {

constexpr std::size_t capacity = 16384;
constexpr std::uint64_t messages_in_all = 200000;

/// What lies in the shared memory, with the ring behind it.
struct Shared {
  ProcessDoorbell producers, consumers;
  std::atomic<std::uint64_t> about_to_publish{0};  ///< messages that may have been published
  std::atomic<std::uint64_t> published{0};         ///< messages that have been
  alignas(cache_line_pair_bytes) std::byte ring[ring_footprint<ProcessAtomics>(capacity)];
};

std::uint64_t mix(std::uint64_t x) {
  x = (x ^ x >> 33) * 0xff51afd7ed558ccdu;
  x = (x ^ x >> 33) * 0xc4ceb9fe1a85ec53u;
  return x ^ x >> 33;
}

std::size_t size_of(std::uint64_t number) { return 8 + mix(number) % 1500; }

std::byte byte_of(std::uint64_t number, std::size_t i) { return std::byte(mix(number) >> i % 8 * 8); }

/// The producer, from message `first` on. Never returns; is killed, or is done.
[[noreturn]] void produce(Shared& shared, std::uint64_t first) {
  prctl(PR_SET_PDEATHSIG, SIGKILL);
  BasicSender<ProcessAtomics> sender(open_ring<ProcessAtomics>(shared.ring), &shared.consumers);
  // A predecessor may have been killed between publishing and ringing.
  shared.consumers.ring();
  for (std::uint64_t number = first; number < messages_in_all; ++number) {
    const std::size_t size = size_of(number);
    std::span<std::byte> room;
    // May publish what is staged, so that is announced before.
    shared.about_to_publish.store(number, std::memory_order_relaxed);
    shared.producers.wait([&] { return !(room = sender.claim(size)).empty(); });
    std::memcpy(room.data(), &number, 8);
    for (std::size_t i = 8; i < size; ++i) room[i] = byte_of(number, i);
    sender.commit(size);
    if (mix(number) % 5 == 0) {
      shared.about_to_publish.store(number + 1, std::memory_order_relaxed);
      sender.publish();
      shared.published.store(number + 1, std::memory_order_relaxed);
    }
  }
  shared.about_to_publish.store(messages_in_all, std::memory_order_relaxed);
  sender.publish();
  shared.published.store(messages_in_all, std::memory_order_relaxed);
  _exit(0);
}

pid_t start_producer(Shared& shared, std::uint64_t first) {
  const pid_t child = fork();
  if (child == 0) produce(shared, first);
  return child;
}

struct Consumer {
  BasicReceiver<ProcessAtomics> receiver;
  std::uint64_t received = 0, wrong = 0;

  /// Takes what is there. The order alone shows that nothing is lost or doubled.
  void drain(std::uint64_t limit) {
    for (;;) {
      if (received == limit) break;
      const auto message = receiver.next();
      if (message.empty()) break;
      std::uint64_t number = 0;
      std::memcpy(&number, message.data(), 8);
      bool right = number == received && message.size() == size_of(number);
      for (std::size_t i = 8; right && i < message.size(); ++i) right = message[i] == byte_of(number, i);
      wrong += !right;
      ++received;
    }
    receiver.release();
  }
};

TEST_CASE("a producer that is killed at random and restarted loses, doubles and tears nothing that it published") {
  const std::uint64_t seed = 4711;
  CAPTURE(seed);
  std::mt19937_64 random(seed);
  const int file = memfd_create("ringfence-link-test", MFD_CLOEXEC);
  REQUIRE(file >= 0);
  REQUIRE(ftruncate(file, sizeof(Shared)) == 0);
  void* memory = mmap(nullptr, sizeof(Shared), PROT_READ | PROT_WRITE, MAP_SHARED, file, 0);
  REQUIRE(memory != MAP_FAILED);
  Shared& shared = *new (memory) Shared;
  make_ring<ProcessAtomics>(shared.ring, capacity);
  // The consumer's own mapping, at another address: the ring holds positions, no pointers.
  void* elsewhere = mmap(nullptr, sizeof(Shared), PROT_READ | PROT_WRITE, MAP_SHARED, file, 0);
  REQUIRE(elsewhere != MAP_FAILED);
  Shared& mine = *static_cast<Shared*>(elsewhere);
  Consumer consumer{{open_ring<ProcessAtomics>(mine.ring), &mine.producers}};

  int killed = 0;
  pid_t producer = start_producer(shared, 0);
  REQUIRE(producer > 0);
  while (consumer.received < messages_in_all && consumer.wrong == 0) {
    const std::uint64_t stop = std::min(messages_in_all, consumer.received + random() % 6000);
    while (consumer.received < stop && consumer.wrong == 0) {
      mine.consumers.wait([&] { return consumer.receiver.has_message(); });
      consumer.drain(stop);
    }
    if (consumer.received == messages_in_all) break;
    REQUIRE(kill(producer, SIGKILL) == 0);
    int status = 0;
    REQUIRE(waitpid(producer, &status, 0) == producer);
    ++killed;
    consumer.drain(messages_in_all);
    CHECK(mine.published.load() <= consumer.received);
    CHECK(consumer.received <= mine.about_to_publish.load());
    producer = start_producer(shared, consumer.received);
    REQUIRE(producer > 0);
  }
  kill(producer, SIGKILL);
  int status = 0;
  REQUIRE(waitpid(producer, &status, 0) == producer);
  CHECK(consumer.wrong == 0);
  CHECK(consumer.received == messages_in_all);
  CHECK(killed > 20);
  munmap(elsewhere, sizeof(Shared));
  munmap(memory, sizeof(Shared));
  close(file);
}

}  // namespace
}  // namespace ringfence::link
