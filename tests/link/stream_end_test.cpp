// Proves the end of a stream between processes: each small program runs in every schedule and with every store that a
// load may see. For each seeded defect, one of the programs must fail.
#include "link/stream_end.hpp"

#include <string>
#include <type_traits>

#include <doctest/doctest.h>

#include "link/checker.hpp"

namespace ringfence::checker {
namespace {

using link::Defect;

/// A stream with rings of `capacity` bytes, whose words are numbered from 1 on, and the events by which each end is
/// woken: what a byte on a socket is between processes.
template <class Policy, std::uint64_t capacity>
struct Stream {
  alignas(8) std::byte memory[2 * capacity] = {};
  link::StreamControl<Policy> control;
  typename Policy::template Atomic<std::uint32_t> events[2]{{0}, {0}};
  link::StreamEnd<Policy> ends[2]{{control, 0, capacity, capacity}, {control, 1, capacity, capacity}};
  std::uint64_t sent[2] = {}, received[2] = {};  ///< words, by end

  Stream() { explorer().watch(memory, sizeof memory); }
  std::byte* at(int writer, std::uint64_t position) {
    return memory + static_cast<std::size_t>(writer) * capacity + position % capacity;
  }
  void wake(int end) {
    events[end].exchange(1, std::memory_order_release);
    Policy::wake(events[end]);
  }
  bool write(int end) {
    if (!ends[end].make_room(8)) return false;
    Policy::write(at(end, ends[end].write_position()), ++sent[end]);
    ends[end].stage(8);
    return true;
  }
  void publish(int end) {
    if (ends[end].publish()) wake(1 - end);
  }
  bool read(int end) {
    if (ends[end].available() == 0 && !ends[end].refresh()) return false;
    if (Policy::read(at(1 - end, ends[end].read_position())) != ++received[end]) {
      explorer().fail("a word is lost, repeated or torn");
    }
    ends[end].take(8);
    return true;
  }
  void release(int end) {
    if (ends[end].release()) wake(1 - end);
  }
  /// Sleeps until there is something to read or, with `awaits_room`, to write.
  void wait(int end, bool awaits_room) {
    if (ends[end].arm(awaits_room)) {
      Policy::sleep(events[end], 0);
      events[end].exchange(0, std::memory_order_acquire);
    }
    ends[end].disarm();
  }
};

/// One end sends, the other one receives; each sleeps when it cannot go on.
template <class Policy, std::uint64_t words, std::uint64_t capacity>
struct OneWay {
  static constexpr int threads = 2;
  Stream<Policy, capacity> stream;

  void thread(int which) {
    if (which == 1) {
      for (std::uint64_t i = 0; i < words; ++i) {
        while (!stream.write(0)) stream.wait(0, true);
        stream.publish(0);
      }
    } else {
      for (std::uint64_t i = 0; i < words; ++i) {
        while (!stream.read(1)) stream.wait(1, false);
        stream.release(1);
      }
    }
  }
  void finish() {
    if (stream.received[1] != words) explorer().fail("a word was lost");
  }
};

/// A request and its reply.
template <class Policy>
struct Reply {
  static constexpr int threads = 2;
  Stream<Policy, 8> stream;

  void thread(int which) {
    const int end = which - 1;
    if (end == 1) receive(end);
    while (!stream.write(end)) stream.wait(end, true);
    stream.publish(end);
    if (end == 0) receive(end);
  }
  void receive(int end) {
    while (!stream.read(end)) stream.wait(end, false);
    stream.release(end);
  }
  void finish() {
    if (stream.received[0] != 1 || stream.received[1] != 1) explorer().fail("a word was lost");
  }
};

/// The reader is awake in between, and clears its request.
template <class Policy>
struct Awake {
  static constexpr int threads = 2;
  Stream<Policy, 16> stream;

  void thread(int which) {
    if (which == 1) {
      for (int i = 0; i < 2; ++i) {
        stream.write(0);
        stream.publish(0);
      }
    } else {
      (void)stream.ends[1].arm(false);
      stream.ends[1].disarm();
      for (int i = 0; i < 2; ++i) {
        while (!stream.read(1)) stream.wait(1, false);
      }
    }
  }
  void finish() {
    if (stream.received[1] != 2) explorer().fail("a word was lost");
  }
};

struct Verdict {
  std::uint64_t executions = 0;
  bool exhausted = true;
  std::string failure, trace;
};

template <Defect defect>
Verdict explore_all() {
  using Policy = CheckedAtomics<defect>;
  Verdict verdict;
  const auto next = [&]<class Program>(std::type_identity<Program>) {
    if (!verdict.failure.empty()) return;
    const Report report = explore<Program>(20'000'000);
    verdict.executions += report.executions;
    verdict.exhausted = verdict.exhausted && report.exhausted;
    verdict.failure = report.failure;
    verdict.trace = report.trace;
  };
  next(std::type_identity<OneWay<Policy, 1, 8>>());
  next(std::type_identity<OneWay<Policy, 2, 8>>());
  next(std::type_identity<Awake<Policy>>());
  next(std::type_identity<Reply<Policy>>());
  next(std::type_identity<OneWay<Policy, 3, 16>>());
  return verdict;
}

TEST_CASE("the ends of a stream hold in every execution of the small programs") {
  const Verdict verdict = explore_all<Defect::none>();
  INFO(verdict.trace);
  CHECK_MESSAGE(verdict.failure.empty(), verdict.failure);
  CHECK(verdict.exhausted);
  MESSAGE(verdict.executions << " executions passed");
}

template <Defect defect>
void expect_found(const char* name) {
  const Verdict verdict = explore_all<defect>();
  CHECK_MESSAGE(!verdict.failure.empty(), name << " survived " << verdict.executions << " executions");
}

TEST_CASE("every seeded defect of the ends of a stream is found") {
  expect_found<Defect::publish_unordered>("publish_unordered");
  expect_found<Defect::peek_unordered>("peek_unordered");
  expect_found<Defect::release_unordered>("release_unordered");
  expect_found<Defect::room_unordered>("room_unordered");
  expect_found<Defect::wait_unordered>("wait_unordered");
  expect_found<Defect::ring_unordered>("ring_unordered");
  expect_found<Defect::arm_unordered>("arm_unordered");
  expect_found<Defect::disarm_by_store>("disarm_by_store");
  expect_found<Defect::no_recheck>("no_recheck");
  expect_found<Defect::flag_set_late>("flag_set_late");
  expect_found<Defect::capacity_off_by_one>("capacity_off_by_one");
  expect_found<Defect::waiting_sender_not_rung>("waiting_sender_not_rung");
  expect_found<Defect::waiting_flag_not_set>("waiting_flag_not_set");
}

}  // namespace
}  // namespace ringfence::checker
