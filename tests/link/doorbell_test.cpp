#include "link/doorbell.hpp"

#include <array>
#include <atomic>
#include <memory>
#include <set>
#include <thread>
#include <vector>

#include <doctest/doctest.h>
#include <sched.h>
#include <unistd.h>

#include "link/cores.hpp"
#include "link/watchdog.hpp"
#include "telemetry/clock.hpp"

namespace ringfence::link {
namespace {

TEST_CASE("a wait whose condition stays false ends at its deadline and returns false") {
  Doorbell bell;
  const auto before = std::chrono::steady_clock::now();
  CHECK_FALSE(bell.wait_for([] { return false; }, std::chrono::milliseconds(2)));
  CHECK(std::chrono::steady_clock::now() - before >= std::chrono::milliseconds(2));
  CHECK(bell.wait_for([] { return true; }, std::chrono::nanoseconds(0)));
}

TEST_CASE("a ring from another thread ends a wait, with or without a deadline, for every spin policy") {
  for (const SpinPolicy spin_policy : {SpinPolicy{0, 0}, SpinPolicy{20, 3}, SpinPolicy{2000, 3}}) {
    auto mine = std::make_unique<BasicDoorbell<ThreadAtomics>>(spin_policy);
    auto theirs = std::make_unique<BasicDoorbell<ThreadAtomics>>(spin_policy);
    std::atomic<int> turn{0};
    constexpr int rounds = 3000;
    Watchdog watchdog("a ring from another thread");
    ThreadProgress& asking = watchdog.add_thread("the asking thread");
    ThreadProgress& answering = watchdog.add_thread("the answering thread");
    asking.set_waiting_for("an answer");
    answering.set_waiting_for("a question");
    std::thread other([&] {
      for (int i = 0; i < rounds; ++i) {
        answering.note_progress();
        theirs->wait([&] { return turn.load(std::memory_order_acquire) == 2 * i + 1; });
        turn.store(2 * i + 2, std::memory_order_release);
        mine->ring();
      }
    });
    int timely = 0;
    for (int i = 0; i < rounds; ++i) {
      asking.note_progress();
      turn.store(2 * i + 1, std::memory_order_release);
      theirs->ring();
      const auto answered = [&] { return turn.load(std::memory_order_acquire) == 2 * i + 2; };
      if (i % 2 == 0) {
        mine->wait(answered);
        ++timely;
      } else {
        timely += mine->wait_for(answered, std::chrono::hours(1));
      }
    }
    other.join();
    CHECK(timely == rounds);
  }
}

TEST_CASE("a wait that polls only after a ring tests its condition a few times only while no thread rings") {
  int polls = 0;
  BasicDoorbell<ThreadAtomics> bell(SpinPolicy{1000, 1000, 0, true});
  const auto never = [&] {
    ++polls;
    return false;
  };
  CHECK_FALSE(bell.wait_for(never, std::chrono::milliseconds(1)));
  CHECK(polls > 0);
  CHECK(polls < 20);  // one before, and one before each sleep, which may end early
}

/// Yields in which other threads run or not, as a test says.
struct ScriptedYields : ThreadAtomics {
  static bool yield() noexcept {
    const bool runs = yields < 64 && (others_run >> yields & 1) != 0;
    ++yields;
    ++since_end;
    return runs;
  }
  static void end_yields() noexcept { since_end = 0; }
  static inline std::uint64_t others_run = 0;  ///< bit i: in yield i
  static inline std::uint32_t yields = 0, since_end = 0;
};

TEST_CASE("before it sleeps, a thread yields a few times, and more often while no other thread wants its core") {
  constexpr std::uint32_t yield_polls = 3, idle_yields = 10;
  const auto yields_before_sleep = [](std::uint64_t others_run) {
    ScriptedYields::others_run = others_run;
    ScriptedYields::yields = 0;
    BasicDoorbell<ScriptedYields> bell(SpinPolicy{.yield_polls = yield_polls, .idle_yields = idle_yields});
    CHECK_FALSE(bell.wait_for([] { return false; }, std::chrono::nanoseconds(0)));
    CHECK(ScriptedYields::since_end == 0);
    return ScriptedYields::yields;
  };
  CHECK(yields_before_sleep(~std::uint64_t{0}) == yield_polls);
  CHECK(yields_before_sleep(0) == idle_yields + yield_polls);
  CHECK(yields_before_sleep(0b1010100) == 7);
  CHECK(yields_before_sleep(0b100000000001) == idle_yields + yield_polls);

  SUBCASE("the condition is tested after the end of the yields is noted") {
    ScriptedYields::others_run = 0;
    BasicDoorbell<ScriptedYields> bell(SpinPolicy{.yield_polls = yield_polls, .idle_yields = idle_yields});
    ScriptedYields::yields = 0;
    int tests = 0;
    bell.wait([&] {
      CHECK(ScriptedYields::since_end == 0);
      return ++tests == 5;
    });
    CHECK(ScriptedYields::yields == 4);
  }
}

TEST_CASE("CPU time of yields in which no other thread runs does not count as work") {
  const std::uint64_t cpu = telemetry::thread_cpu_ns();
  const std::uint64_t working = telemetry::working_cpu_ns(), polled = telemetry::polled_cpu_ns;
  while (ThreadAtomics::yield()) {
  }
  ThreadAtomics::end_yields();
  const std::uint64_t polled_now = telemetry::polled_cpu_ns - polled;
  const std::uint64_t working_now = telemetry::working_cpu_ns() - working;
  CHECK(polled_now > 0);
  CHECK(polled_now + working_now <= telemetry::thread_cpu_ns() - cpu);
  ThreadAtomics::end_yields();  // nothing was polled since
  CHECK(telemetry::polled_cpu_ns - polled == polled_now);
}

TEST_CASE("one sleeper misses no ring of many threads") {
  constexpr int ringers = 6, times = 4000;
  auto bell = std::make_unique<Doorbell>();
  std::array<std::atomic<int>, ringers> counts{};
  std::vector<std::thread> threads;
  for (int i = 0; i < ringers; ++i) {
    threads.emplace_back([&, i] {
      for (int n = 1; n <= times; ++n) {
        counts[i].store(n, std::memory_order_release);
        bell->ring();
      }
    });
  }
  Watchdog watchdog("one sleeper and many ringing threads");
  ThreadProgress& progress = watchdog.add_thread("the sleeper");
  progress.set_waiting_for("a ring");
  int seen_sum = 0;
  while (seen_sum < ringers * times) {
    progress.note_progress();
    int sum = 0;
    bell->wait([&] {
      sum = 0;
      for (const auto& count : counts) sum += count.load(std::memory_order_acquire);
      return sum > seen_sum;
    });
    seen_sum = sum;
  }
  for (std::thread& thread : threads) thread.join();
  CHECK(seen_sum == ringers * times);
}

TEST_CASE("a doorbell that watches a descriptor wakes by rings, by the descriptor, and at its deadline") {
  int pipe_ends[2];
  REQUIRE(::pipe(pipe_ends) == 0);
  Doorbell bell;
  REQUIRE(bell.prepare_to_watch());
  bell.watch(pipe_ends[0]);
  Watchdog watchdog("a doorbell that watches a descriptor");
  ThreadProgress& progress = watchdog.add_thread("owner");
  constexpr int turns = 2000;
  std::atomic<int> rings{0};
  std::atomic<int> bytes{0};
  std::atomic<int> seen{0};
  // Each of the two continues when the owner has seen its last signal.
  std::thread ringer([&] {
    for (int turn = 1; turn <= turns; ++turn) {
      rings.store(turn, std::memory_order_release);
      bell.ring();
      while (seen.load(std::memory_order_acquire) % (turns + 1) < turn) std::this_thread::yield();
    }
  });
  std::thread writer([&] {
    for (int turn = 1; turn <= turns; ++turn) {
      bytes.store(turn, std::memory_order_release);
      const char byte = 1;
      if (::write(pipe_ends[1], &byte, 1) != 1) return;
      while (seen.load(std::memory_order_acquire) / (turns + 1) < turn) std::this_thread::yield();
    }
  });
  progress.set_waiting_for("a ring or a byte");
  int ring = 0;
  int byte = 0;
  while (ring < turns || byte < turns) {
    progress.note_progress();
    bell.wait(
        [&] { return rings.load(std::memory_order_acquire) > ring || bytes.load(std::memory_order_acquire) > byte; });
    ring = rings.load(std::memory_order_acquire);
    for (char read = 0; byte < bytes.load(std::memory_order_acquire); ++byte) {
      if (::read(pipe_ends[0], &read, 1) != 1) return;
    }
    seen.store(byte * (turns + 1) + ring, std::memory_order_release);
  }
  ringer.join();
  writer.join();
  CHECK_FALSE(bell.wait_for([] { return false; }, std::chrono::milliseconds(2)));
  ::close(pipe_ends[0]);
  ::close(pipe_ends[1]);
}

TEST_CASE("a thread pinned to each core in turn runs on all cores") {
  const Cores cores;
  std::set<int> seen;
  std::thread([&] {
    for (std::size_t i = 0; i < cores.count(); ++i) {
      if (cores.pin_this_thread(i)) seen.insert(sched_getcpu());
    }
  }).join();
  // If the system refuses to pin, it always refuses.
  CHECK((seen.empty() || seen.size() == cores.count()));
}

}  // namespace
}  // namespace ringfence::link
