// The ring between two processes: the producer is killed at random times, and a new producer takes over.
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
constexpr std::uint64_t message_count = 200000;

/// The contents of the shared memory; the ring is last.
struct Shared {
  ProcessDoorbell producers, consumers;
  std::atomic<std::uint64_t> about_to_publish{0};  ///< upper limit of the number of published messages
  std::atomic<std::uint64_t> published{0};         ///< lower limit of the number of published messages
  alignas(cache_line_pair_bytes) std::byte ring[ring_footprint<ProcessAtomics>(capacity)];
};

std::uint64_t mix(std::uint64_t x) {
  x = (x ^ x >> 33) * 0xff51afd7ed558ccdu;
  x = (x ^ x >> 33) * 0xc4ceb9fe1a85ec53u;
  return x ^ x >> 33;
}

/// Sizes come in fives, so that there are runs.
std::size_t size_of(std::uint64_t number) { return 8 + mix(number / 5) % 1500; }

std::byte byte_of(std::uint64_t number, std::size_t i) { return std::byte(mix(number) >> i % 8 * 8); }

/// Produces the messages from `first` on. Never returns: the process is killed, or exits when it is done.
[[noreturn]] void produce(Shared& shared, std::uint64_t first) {
  prctl(PR_SET_PDEATHSIG, SIGKILL);
  // Staged messages are in the memory of this process, and are lost with it.
  alignas(cache_line_pair_bytes) static std::byte stage[4096 + 2048];
  BasicSender<ProcessAtomics> sender(open_ring<ProcessAtomics>(shared.ring), &shared.consumers, stage);
  // The previous producer may have been killed between publishing and ringing.
  shared.consumers.ring();
  for (std::uint64_t number = first; number < message_count; ++number) {
    const std::size_t size = size_of(number);
    std::span<std::byte> room;
    // claim() may publish the staged messages, so about_to_publish includes them before the call.
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
  shared.about_to_publish.store(message_count, std::memory_order_relaxed);
  sender.publish();
  shared.published.store(message_count, std::memory_order_relaxed);
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

  /// Reads the available messages, until `limit` messages have been received in total. Each must have the next number,
  /// so none is lost or duplicated.
  void drain(std::uint64_t limit) {
    for (;;) {
      if (received == limit) break;
      const auto message = receiver.next();
      if (message.empty()) break;
      std::uint64_t number = 0;
      std::memcpy(&number, message.data(), 8);
      bool correct = number == received && message.size() == size_of(number);
      for (std::size_t i = 8; correct && i < message.size(); ++i) correct = message[i] == byte_of(number, i);
      wrong += !correct;
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
  // The consumer maps the memory at another address, because the ring must contain positions and no pointers.
  void* consumer_memory = mmap(nullptr, sizeof(Shared), PROT_READ | PROT_WRITE, MAP_SHARED, file, 0);
  REQUIRE(consumer_memory != MAP_FAILED);
  Shared& consumer_view = *static_cast<Shared*>(consumer_memory);
  Consumer consumer{{open_ring<ProcessAtomics>(consumer_view.ring), &consumer_view.producers}};

  int killed = 0;
  pid_t producer = start_producer(shared, 0);
  REQUIRE(producer > 0);
  while (consumer.received < message_count && consumer.wrong == 0) {
    const std::uint64_t stop = std::min(message_count, consumer.received + random() % 6000);
    while (consumer.received < stop && consumer.wrong == 0) {
      consumer_view.consumers.wait([&] { return consumer.receiver.has_message(); });
      consumer.drain(stop);
    }
    if (consumer.received == message_count) break;
    REQUIRE(kill(producer, SIGKILL) == 0);
    int status = 0;
    REQUIRE(waitpid(producer, &status, 0) == producer);
    ++killed;
    consumer.drain(message_count);
    CHECK(consumer_view.published.load() <= consumer.received);
    CHECK(consumer.received <= consumer_view.about_to_publish.load());
    producer = start_producer(shared, consumer.received);
    REQUIRE(producer > 0);
  }
  kill(producer, SIGKILL);
  int status = 0;
  REQUIRE(waitpid(producer, &status, 0) == producer);
  CHECK(consumer.wrong == 0);
  CHECK(consumer.received == message_count);
  CHECK(killed > 20);
  munmap(consumer_memory, sizeof(Shared));
  munmap(memory, sizeof(Shared));
  close(file);
}

}  // namespace
}  // namespace ringfence::link
