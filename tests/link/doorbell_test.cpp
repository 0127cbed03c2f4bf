#include "link/doorbell.hpp"

#include <array>
#include <atomic>
#include <memory>
#include <set>
#include <thread>
#include <vector>

#include <doctest/doctest.h>
#include <sched.h>

#include "link/cores.hpp"
#include "link/watchdog.hpp"

namespace ringfence::link {
namespace {

TEST_CASE("a wait whose condition never comes true ends at its deadline, and says so") {
  Doorbell bell;
  const auto before = std::chrono::steady_clock::now();
  CHECK_FALSE(bell.wait_for([] { return false; }, std::chrono::milliseconds(2)));
  CHECK(std::chrono::steady_clock::now() - before >= std::chrono::milliseconds(2));
  CHECK(bell.wait_for([] { return true; }, std::chrono::nanoseconds(0)));
}

TEST_CASE("a ring from another thread ends a wait, with or without a deadline, however long one looks first") {
  for (const SpinPolicy spin_policy : {SpinPolicy{0, 0}, SpinPolicy{20, 3}, SpinPolicy{2000, 3}}) {
    auto mine = std::make_unique<BasicDoorbell<ThreadAtomics>>(spin_policy);
    auto theirs = std::make_unique<BasicDoorbell<ThreadAtomics>>(spin_policy);
    std::atomic<int> turn{0};
    constexpr int rounds = 3000;
    Watchdog dog("a ring from another thread");
    Post& ours = dog.post("who asks");
    Post& others = dog.post("who answers");
    ours.waits_for("an answer");
    others.waits_for("a question");
    std::thread other([&] {
      for (int i = 0; i < rounds; ++i) {
        others.moves();
        theirs->wait([&] { return turn.load(std::memory_order_acquire) == 2 * i + 1; });
        turn.store(2 * i + 2, std::memory_order_release);
        mine->ring();
      }
    });
    int timely = 0;
    for (int i = 0; i < rounds; ++i) {
      ours.moves();
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

TEST_CASE("who looks by the bell looks at the condition a few times while nobody rings, however patient") {
  int looks = 0;
  BasicDoorbell<ThreadAtomics> bell(SpinPolicy{1000, 1000, 0, true});
  const auto never = [&] {
    ++looks;
    return false;
  };
  CHECK_FALSE(bell.wait_for(never, std::chrono::milliseconds(1)));
  CHECK(looks > 0);
  CHECK(looks < 20);  // once before, once before each sleep, which may end early
}

TEST_CASE("many ringers and one sleeper: nothing that was told is missed") {
  constexpr int ringers = 6, times = 4000;
  auto bell = std::make_unique<Doorbell>();
  std::array<std::atomic<int>, ringers> told{};
  std::vector<std::thread> threads;
  for (int i = 0; i < ringers; ++i) {
    threads.emplace_back([&, i] {
      for (int n = 1; n <= times; ++n) {
        told[i].store(n, std::memory_order_release);
        bell->ring();
      }
    });
  }
  Watchdog dog("many ringers and one sleeper");
  Post& post = dog.post("the sleeper");
  post.waits_for("a ring");
  int heard = 0;
  while (heard < ringers * times) {
    post.moves();
    int sum = 0;
    bell->wait([&] {
      sum = 0;
      for (const auto& count : told) sum += count.load(std::memory_order_acquire);
      return sum > heard;
    });
    heard = sum;
  }
  for (std::thread& thread : threads) thread.join();
  CHECK(heard == ringers * times);
}

TEST_CASE("a thread that is pinned to each core in turn runs on as many cores as there are") {
  const Cores cores;
  std::set<int> seen;
  std::thread([&] {
    for (std::size_t i = 0; i < cores.count(); ++i) {
      if (cores.pin_this_thread(i)) seen.insert(sched_getcpu());
    }
  }).join();
  // Where the system refuses to pin, it refuses always.
  CHECK((seen.empty() || seen.size() == cores.count()));
}

}  // namespace
}  // namespace ringfence::link
