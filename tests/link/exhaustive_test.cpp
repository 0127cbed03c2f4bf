// Proves ring, doorbell and channel: each small program below runs in every schedule and with every store that a load
// may see. For each seeded defect, one of the programs must fail.
#include <chrono>
#include <string>
#include <type_traits>

#include <doctest/doctest.h>

#include "link/channel.hpp"
#include "link/checker.hpp"

namespace ringfence::checker {
namespace {

using link::Defect;

/// Memory for two of the smallest rings: 64 bytes each, messages of at most 32 bytes.
template <class Policy>
struct Rings {
  static constexpr std::uint64_t capacity = 64;
  static constexpr std::size_t footprint = link::ring_footprint<Policy>(capacity);
  alignas(link::cache_line_pair_bytes) std::byte memory[2 * footprint];

  Rings() { explorer().watch(memory, sizeof memory); }
  link::Ring<Policy> make(int which) { return link::make_ring<Policy>(memory + which * footprint, capacity); }
};

/// Memory for a stage of four lines. What follows is for defects that write past its end.
struct Stage {
  alignas(64) std::byte memory[512];

  Stage() { explorer().own(memory, sizeof memory); }
  std::span<std::byte> use() { return {memory, 64}; }
};

/// Word i of a message.
std::uint64_t message_word(int message, std::size_t i) { return static_cast<std::uint64_t>(message) * 100 + i + 1; }

/// Claims `claimed` bytes and uses `size` of them.
template <class Policy>
bool send(link::BasicSender<Policy>& sender, int message, std::size_t size, std::size_t claimed) {
  const std::span<std::byte> room = sender.claim(claimed);
  if (room.empty()) return false;
  for (std::size_t i = 0; i < size / 8; ++i) Policy::write(room.data() + 8 * i, message_word(message, i));
  sender.commit(size);
  return true;
}

template <class Policy>
bool send(link::BasicSender<Policy>& sender, int message, std::size_t size) {
  return send(sender, message, size, size);
}

template <class Policy>
void expect(std::span<const std::byte> message, int number, std::size_t size) {
  if (message.size() != size) return explorer().fail("a message has another length than was sent");
  for (std::size_t i = 0; i < size / 8; ++i) {
    if (Policy::read(message.data() + 8 * i) != message_word(number, i))
      return explorer().fail("a message is torn or out of order");
  }
}

/// Two threads that never wait: every accepted message arrives once, complete and in order. The sizes fill the ring to
/// the last byte, cross its end, and need padding.
template <class Policy>
struct Polling {
  static constexpr int threads = 2;
  static constexpr int tries = 8, polls = 8;
  static std::size_t size_of(int message) { return (message % 3 == 0) ? 12 : (message % 3 == 1) ? 24 : 16; }

  Rings<Policy> rings;
  link::Ring<Policy> ring = rings.make(0);
  link::BasicSender<Policy> sender{ring, nullptr};
  link::BasicReceiver<Policy> receiver{ring, nullptr};
  int sent = 0, received = 0;

  void thread(int which) {
    if (which == 1) {
      for (int i = 0; i < tries; ++i) {
        if (send(sender, sent, size_of(sent))) ++sent;
        if (i % 2 == 1) sender.publish();
      }
      sender.publish();
    } else {
      for (int i = 0; i < polls; ++i) poll(i % 2 == 1);
    }
  }
  void poll(bool release) {
    const auto message = receiver.next();
    if (!message.empty()) expect<Policy>(message, received, size_of(received)), ++received;
    if (release) receiver.release();
  }
  void finish() {
    for (int i = 0; i <= tries && !explorer().failed(); ++i) poll(true);
    if (sent != received) explorer().fail("a message was lost or duplicated");
  }
};

/// One thread sends, one receives, and both sleep when they cannot continue: until the last message or the close.
template <class Policy, int messages, std::size_t size, bool publish_each, bool closing, bool staged = false>
struct Streaming {
  static constexpr int threads = 2;

  Rings<Policy> rings;
  Stage stage;
  link::Ring<Policy> ring = rings.make(0);
  link::BasicDoorbell<Policy> senders_bell, receivers_bell;
  link::BasicSender<Policy> sender{ring, &receivers_bell, staged ? stage.use() : std::span<std::byte>{}};
  link::BasicReceiver<Policy> receiver{ring, &senders_bell};
  int received = 0;

  void thread(int which) {
    if (which == 1) {
      for (int i = 0; i < messages; ++i) {
        senders_bell.wait([&] { return send(sender, i, size); });
        if (publish_each) sender.publish();
      }
      closing ? sender.close() : sender.publish();
    } else {
      while (closing || received < messages) {
        receivers_bell.wait([&] { return receiver.has_message() || receiver.closed(); });
        const auto message = receiver.next();
        if (message.empty()) return;
        expect<Policy>(message, received++, size);
        receiver.release();
      }
    }
  }
  void finish() {
    if (received != messages) explorer().fail("a message was lost");
  }
};

/// The receiver closes while the sender waits for room.
template <class Policy>
struct ReceiverCloses {
  static constexpr int threads = 2;

  Rings<Policy> rings;
  link::Ring<Policy> ring = rings.make(0);
  link::BasicDoorbell<Policy> senders_bell, receivers_bell;
  link::BasicSender<Policy> sender{ring, &receivers_bell};
  link::BasicReceiver<Policy> receiver{ring, &senders_bell};

  void thread(int which) {
    if (which == 1) {
      for (int i = 0; i < 4; ++i) {
        senders_bell.wait([&] { return sender.closed() || send(sender, i, 32); });
        sender.publish();
      }
    } else {
      receivers_bell.wait([&] { return receiver.has_message(); });
      expect<Policy>(receiver.next(), 0, 32);
      receiver.release();
      receiver.close();
    }
  }
  void finish() {
    if (!sender.closed()) explorer().fail("the close was lost");
  }
};

/// Request and reply: each thread has one doorbell for both directions.
template <class Policy>
struct Echo {
  static constexpr int threads = 2;
  static constexpr int rounds = 2;

  Rings<Policy> rings;
  link::Ring<Policy> forward_ring = rings.make(0), backward_ring = rings.make(1);
  link::BasicDoorbell<Policy> first_bell, second_bell;
  link::BasicSender<Policy> request_sender{forward_ring, &second_bell}, reply_sender{backward_ring, &first_bell};
  link::BasicReceiver<Policy> request_receiver{forward_ring, &first_bell}, reply_receiver{backward_ring, &second_bell};

  void thread(int which) {
    for (int i = 0; i < rounds; ++i) {
      if (which == 1) {
        first_bell.wait([&] { return send(request_sender, i, 8); });
        request_sender.publish();
        first_bell.wait([&] { return reply_receiver.has_message(); });
        expect<Policy>(reply_receiver.next(), i, 8);
        reply_receiver.release();
      } else {
        second_bell.wait([&] { return request_receiver.has_message(); });
        expect<Policy>(request_receiver.next(), i, 8);
        request_receiver.release();
        second_bell.wait([&] { return send(reply_sender, i, 8); });
        reply_sender.publish();
      }
    }
  }
  void finish() {}
};

/// Polls once, then only after a ring.
constexpr link::SpinPolicy poll_after_ring{1, 0, 0, true};

/// Two threads ring one doorbell, each after a message in its own ring. The later ring must not hide the earlier
/// message.
template <class Policy, bool poll_only_after_ring>
struct TwoSenders {
  static constexpr int threads = 3;

  Rings<Policy> rings;
  link::Ring<Policy> ring[2] = {rings.make(0), rings.make(1)};
  link::BasicDoorbell<Policy> bell{poll_only_after_ring ? poll_after_ring : link::SpinPolicy{}};
  link::BasicSender<Policy> first{ring[0], &bell}, second{ring[1], &bell};
  link::BasicReceiver<Policy> from_first{ring[0], nullptr}, from_second{ring[1], nullptr};

  void thread(int which) {
    if (which == 1) {
      send(first, 0, 8);
      first.publish();
    } else if (which == 2) {
      send(second, 1, 8);
      second.publish();
    } else {
      bell.wait([&] { return from_first.has_message(); });
      expect<Policy>(from_first.next(), 0, 8);
      bell.wait([&] { return from_second.has_message(); });
      expect<Policy>(from_second.next(), 1, 8);
    }
  }
  void finish() {}
};

/// Small and larger messages, published one by one and together, by threads that never wait. Small messages start on a
/// cache line where that keeps them within one line; both sides prefetch.
template <class Policy>
struct Lines {
  static constexpr int threads = 2;
  static constexpr int tries = 6;
  static std::size_t size_of(int message) { return message == 1 ? 24 : 8; }

  Rings<Policy> rings;
  link::Ring<Policy> ring = rings.make(0);
  link::BasicSender<Policy> sender{ring, nullptr};
  link::BasicReceiver<Policy> receiver{ring, nullptr};
  int sent = 0, received = 0;

  void thread(int which) {
    for (int i = 0; i < tries; ++i) {
      if (which == 1) {
        if (send(sender, sent, size_of(sent))) ++sent;
        if (i != 3) sender.publish();
      } else {
        poll(i % 3 == 1);
      }
    }
  }
  void poll(bool release) {
    const auto message = receiver.next();
    if (!message.empty()) expect<Policy>(message, received, size_of(received)), ++received;
    if (release) receiver.release();
  }
  void finish() {
    for (int i = 0; i <= tries && !explorer().failed(); ++i) poll(true);
    if (sent != received) explorer().fail("a message was lost or duplicated");
  }
};

/// Messages in the stage and in place, published together, by threads that never wait.
///
/// Script 0: a large message after a staged one. 1: a stage that crosses the end of the ring. 2: large messages that
/// need the room of a run. 3: a message that is shorter than its claim in a run. In 1 and 3, two messages were read
/// before the threads start.
template <class Policy, int script>
struct Staging {
  static constexpr int threads = 2;
  struct Message {
    std::size_t claimed, used;
  };
  static constexpr Message scripts[4][5] = {{{8, 8}, {8, 8}, {24, 24}, {16, 16}, {8, 8}},
                                            {{8, 8}, {16, 16}, {8, 8}, {16, 16}, {8, 8}},
                                            {{8, 8}, {8, 8}, {8, 8}, {24, 24}, {24, 24}},
                                            {{24, 24}, {24, 24}, {16, 16}, {16, 8}, {8, 8}}};
  static constexpr int messages = 5, read_before = script % 2 == 1 ? 2 : 0, polls = 6;
  static Message message(int number) { return scripts[script][number]; }

  Rings<Policy> rings;
  Stage stage;
  link::Ring<Policy> ring = rings.make(0);
  link::BasicSender<Policy> sender{ring, nullptr, stage.use()};
  link::BasicReceiver<Policy> receiver{ring, nullptr};
  int sent = 0, received = 0;

  Staging() {
    while (sent < read_before) send_next();
    sender.publish();
    while (received < read_before) poll(true);
  }
  void thread(int which) {
    if (which == 1) {
      for (int tried = read_before + 1; tried <= messages; ++tried) {
        send_next();
        if ((tried - read_before) % 3 == 0) sender.publish();
      }
      sender.publish();
    } else {
      for (int i = 0; i < polls; ++i) poll(i % 2 == 1);
    }
  }
  void send_next() {
    if (send(sender, sent, message(sent).used, message(sent).claimed)) ++sent;
  }
  void poll(bool release) {
    const auto next = receiver.next();
    if (!next.empty()) expect<Policy>(next, received, message(received).used), ++received;
    if (release) receiver.release();
  }
  void finish() {
    for (int i = 0; i <= messages && !explorer().failed(); ++i) poll(true);
    if (sent != received) explorer().fail("a message was lost or duplicated");
  }
};

/// Waits with deadlines that may pass at any moment. A wait that times out returns false, and the thread can wait
/// again.
template <class Policy>
struct TimedWaits {
  static constexpr int threads = 2;
  static constexpr int messages = 2;

  Rings<Policy> rings;
  link::Ring<Policy> ring = rings.make(0);
  link::BasicDoorbell<Policy> senders_bell, receivers_bell;
  link::BasicSender<Policy> sender{ring, &receivers_bell};
  link::BasicReceiver<Policy> receiver{ring, &senders_bell};

  static constexpr Time deadline{std::chrono::seconds(1)};

  void thread(int which) {
    for (int i = 0; i < messages; ++i) {
      if (which == 1) {
        const auto sent_one = [&] { return send(sender, i, 32); };
        if (i == 0 || !senders_bell.wait_until(sent_one, deadline)) senders_bell.wait(sent_one);
        sender.publish();
      } else {
        const auto has_one = [&] { return receiver.has_message(); };
        if (i == 1 || !receivers_bell.wait_until(has_one, deadline)) receivers_bell.wait(has_one);
        expect<Policy>(receiver.next(), i, 32);
        receiver.release();
      }
    }
  }
  void finish() {}
};

/// A thread rings, but the condition stays false: the deadline ends the wait.
template <class Policy>
struct Timeout {
  static constexpr int threads = 2;

  Rings<Policy> rings;
  link::BasicDoorbell<Policy> bell;
  bool returned_true = true;

  void thread(int which) {
    if (which == 1) {
      bell.ring();
    } else {
      returned_true = bell.wait_until([] { return false; }, Time(std::chrono::seconds(1)));
    }
  }
  void finish() {
    if (returned_true) explorer().fail("a wait that timed out returned true");
  }
};

/// Far more than any program here needs: a program that is too large fails, it is not cut off.
constexpr std::uint64_t max_executions = 20'000'000;

struct Verdict {
  std::uint64_t executions = 0, pruned = 0;
  bool exhausted = true;
  std::string failure, trace;
};

/// Explores all programs with one version of the code, the quickest first, until one fails.
template <Defect defect>
Verdict explore_all() {
  using Policy = CheckedAtomics<defect>;
  Verdict verdict;
  const auto next = [&]<class Program>(const char* name, std::type_identity<Program>) {
    if (!verdict.failure.empty()) return;
    const Report report = explore<Program>(max_executions);
    verdict.executions += report.executions;
    verdict.pruned += report.pruned;
    verdict.exhausted = verdict.exhausted && report.exhausted;
    if (report.failure.empty()) return;
    verdict.failure = std::string(name) + ": " + report.failure;
    verdict.trace = report.trace;
  };
  next("timeout", std::type_identity<Timeout<Policy>>());
  next("two senders", std::type_identity<TwoSenders<Policy, false>>());
  next("two senders, polls after a ring only", std::type_identity<TwoSenders<Policy, true>>());
  next("one message and the end", std::type_identity<Streaming<Policy, 1, 32, true, true>>());
  next("two messages, room for one", std::type_identity<Streaming<Policy, 2, 32, true, false>>());
  next("three messages, published when full", std::type_identity<Streaming<Policy, 3, 24, false, false>>());
  next("the receiver closes", std::type_identity<ReceiverCloses<Policy>>());
  next("cache lines", std::type_identity<Lines<Policy>>());
  next("a large message after a staged one", std::type_identity<Staging<Policy, 0>>());
  next("a stage that crosses the end", std::type_identity<Staging<Policy, 1>>());
  next("large messages after a run", std::type_identity<Staging<Policy, 2>>());
  next("a short message in a run", std::type_identity<Staging<Policy, 3>>());
  using Streamed = StreamedCopies<Policy>;
  next("all of it staged", std::type_identity<Staging<Streamed, 0>>());
  next("all of it staged, across the end", std::type_identity<Staging<Streamed, 1>>());
  next("all of it staged, after a run", std::type_identity<Staging<Streamed, 2>>());
  next("all of it staged, a short message in a run", std::type_identity<Staging<Streamed, 3>>());
  next("two messages, staged alone", std::type_identity<Streaming<Streamed, 2, 32, true, true, true>>());
  next("two messages and the end", std::type_identity<Streaming<Policy, 2, 32, true, true>>());
  next("echo", std::type_identity<Echo<Policy>>());
  next("polling", std::type_identity<Polling<Policy>>());
  next("three messages, room for one", std::type_identity<Streaming<Policy, 3, 32, true, false>>());
  next("four messages, published when full", std::type_identity<Streaming<Policy, 4, 16, false, false>>());
  next("four staged messages, published when full", std::type_identity<Streaming<Policy, 4, 16, false, false, true>>());
  next("timed waits", std::type_identity<TimedWaits<Policy>>());
  return verdict;
}

double seconds_since(std::chrono::steady_clock::time_point begin) {
  return std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
}

TEST_CASE("ring, doorbell and channel hold in every execution of the small programs") {
  const auto begin = std::chrono::steady_clock::now();
  const Verdict verdict = explore_all<Defect::none>();
  INFO(verdict.trace);
  CHECK_MESSAGE(verdict.failure.empty(), verdict.failure);
  CHECK(verdict.exhausted);
  MESSAGE(verdict.executions << " executions passed; " << verdict.pruned << " redundant ones pruned; "
                             << seconds_since(begin) << " s");
}

/// Statistics of the seeded defects: how many were found, in how many executions, and by which program.
struct Tally {
  int killed = 0, survived = 0;
  std::uint64_t executions = 0;
  std::string report;
};

template <Defect defect>
void expect_found(const char* name, Tally& tally) {
  const Verdict verdict = explore_all<defect>();
  const bool found = !verdict.failure.empty();
  CHECK_MESSAGE(found, name << " survived " << verdict.executions << " executions");
  ++(found ? tally.killed : tally.survived);
  tally.executions += verdict.executions;
  tally.report +=
      "\n  " + std::string(name) + " after " + std::to_string(verdict.executions) + " by " + verdict.failure;
}

TEST_CASE("every seeded defect of ring, doorbell and channel is found") {
  const auto begin = std::chrono::steady_clock::now();
  Tally tally;
  expect_found<Defect::publish_unordered>("publish_unordered", tally);
  expect_found<Defect::peek_unordered>("peek_unordered", tally);
  expect_found<Defect::release_unordered>("release_unordered", tally);
  expect_found<Defect::room_unordered>("room_unordered", tally);
  expect_found<Defect::wait_unordered>("wait_unordered", tally);
  expect_found<Defect::ring_unordered>("ring_unordered", tally);
  expect_found<Defect::arm_unordered>("arm_unordered", tally);
  expect_found<Defect::disarm_by_store>("disarm_by_store", tally);
  expect_found<Defect::no_recheck>("no_recheck", tally);
  expect_found<Defect::flag_set_late>("flag_set_late", tally);
  expect_found<Defect::capacity_off_by_one>("capacity_off_by_one", tally);
  expect_found<Defect::early_release>("early_release", tally);
  expect_found<Defect::padding_lost>("padding_lost", tally);
  expect_found<Defect::stride_not_updated>("stride_not_updated", tally);
  expect_found<Defect::stride_updated_late>("stride_updated_late", tally);
  expect_found<Defect::stage_copied_late>("stage_copied_late", tally);
  expect_found<Defect::stage_overtaken>("stage_overtaken", tally);
  expect_found<Defect::stage_crosses_end>("stage_crosses_end", tally);
  expect_found<Defect::length_of_run_not_checked>("length_of_run_not_checked", tally);
  expect_found<Defect::run_released_early>("run_released_early", tally);
  expect_found<Defect::prefetched_unreleased>("prefetched_unreleased", tally);
  expect_found<Defect::evicted_released>("evicted_released", tally);
  expect_found<Defect::prefetched_unpublished>("prefetched_unpublished", tally);
  expect_found<Defect::overhang_lost>("overhang_lost", tally);
  expect_found<Defect::waiting_sender_not_rung>("waiting_sender_not_rung", tally);
  expect_found<Defect::waiting_flag_not_set>("waiting_flag_not_set", tally);
  expect_found<Defect::no_publish_when_full>("no_publish_when_full", tally);
  expect_found<Defect::close_without_ring>("close_without_ring", tally);
  expect_found<Defect::deadline_not_set>("deadline_not_set", tally);
  expect_found<Defect::deadline_not_checked>("deadline_not_checked", tally);
  expect_found<Defect::timeout_reported_as_ready>("timeout_reported_as_ready", tally);
  expect_found<Defect::ring_cleared_by_store>("ring_cleared_by_store", tally);
  static_assert(static_cast<int>(Defect::ring_cleared_by_store) == 32, "a defect was added: test it here too");
  CHECK(tally.killed + tally.survived == 32);
  MESSAGE(tally.killed << " mutants killed, " << tally.survived << " survived; " << tally.executions << " executions, "
                       << seconds_since(begin) << " s:" << tally.report);
}

}  // namespace
}  // namespace ringfence::checker
