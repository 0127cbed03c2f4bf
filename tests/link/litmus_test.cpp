// Litmus tests with known results: the checker must allow every outcome that C++ allows, except those of load buffering
// (see checker.hpp), and no other outcome.
#include <set>
#include <utility>

#include <doctest/doctest.h>

#include "link/checker.hpp"

namespace ringfence::checker {
namespace {

using Outcomes = std::set<std::pair<std::uint64_t, std::uint64_t>>;
constexpr auto relaxed = std::memory_order_relaxed, acquire = std::memory_order_acquire,
               release = std::memory_order_release;
Outcomes outcomes;

/// Two locations and the results of two loads.
struct Litmus {
  Atomic<std::uint64_t> x{0}, y{0};
  std::uint64_t first = 9, second = 9;
  void finish() { outcomes.insert({first, second}); }
};

template <class Program>
Outcomes outcomes_of() {
  outcomes.clear();
  const Report report = explore<Program>(1'000'000);
  CHECK(report.exhausted);
  CHECK(report.failure.empty());
  return outcomes;
}

template <std::memory_order store_order, std::memory_order load_order>
struct MessagePassing : Litmus {
  static constexpr int threads = 2;
  void thread(int which) {
    if (which == 1) {
      x.store(1, relaxed);
      y.store(1, store_order);
    } else {
      first = y.load(load_order);
      second = x.load(relaxed);
    }
  }
};

TEST_CASE("the checker lets a flag overtake its data unless it is released and acquired") {
  const Outcomes ordered{{0, 0}, {0, 1}, {1, 1}};
  Outcomes all = ordered;
  all.insert({1, 0});
  CHECK(outcomes_of<MessagePassing<release, acquire>>() == ordered);
  CHECK(outcomes_of<MessagePassing<relaxed, acquire>>() == all);
  CHECK(outcomes_of<MessagePassing<release, relaxed>>() == all);
}

template <bool by_exchange>
struct StoreBuffering : Litmus {
  static constexpr int threads = 2;
  void thread(int which) {
    Atomic<std::uint64_t>& mine = which == 1 ? x : y;
    Atomic<std::uint64_t>& other = which == 1 ? y : x;
    by_exchange ? static_cast<void>(mine.exchange(1, std::memory_order_acq_rel)) : mine.store(1, release);
    (which == 1 ? first : second) = other.load(acquire);
  }
};

TEST_CASE("the checker lets two threads miss each other's stores, and each other's exchanges elsewhere") {
  const Outcomes all{{0, 0}, {0, 1}, {1, 0}, {1, 1}};
  CHECK(outcomes_of<StoreBuffering<false>>() == all);
  CHECK(outcomes_of<StoreBuffering<true>>() == all);
}

struct LoadBuffering : Litmus {
  static constexpr int threads = 2;
  void thread(int which) {
    if (which == 1) {
      first = x.load(relaxed);
      y.store(1, relaxed);
    } else {
      second = y.load(relaxed);
      x.store(1, relaxed);
    }
  }
};

TEST_CASE("the checker does not cover load buffering") {
  CHECK(outcomes_of<LoadBuffering>() == Outcomes{{0, 0}, {0, 1}, {1, 0}});
}

struct Coherence : Litmus {
  static constexpr int threads = 2;
  void thread(int which) {
    if (which == 1) {
      x.store(1, relaxed);
      x.store(2, relaxed);
    } else {
      first = x.load(relaxed);
      second = x.load(relaxed);
    }
  }
};

TEST_CASE("the checker never shows a thread an older store after a newer one") {
  CHECK(outcomes_of<Coherence>() == Outcomes{{0, 0}, {0, 1}, {0, 2}, {1, 1}, {1, 2}, {2, 2}});
}

struct Exchanges : Litmus {
  static constexpr int threads = 2;
  void thread(int which) { (which == 1 ? first : second) = x.exchange(static_cast<std::uint64_t>(which), relaxed); }
};

TEST_CASE("the checker orders exchanges of one location one after the other") {
  CHECK(outcomes_of<Exchanges>() == Outcomes{{0, 1}, {2, 0}});
}

/// A relaxed exchange by a third thread continues the release sequence of the store before it.
struct ReleaseSequence : Litmus {
  static constexpr int threads = 3;
  void thread(int which) {
    if (which == 1) {
      x.store(1, relaxed);
      y.store(1, release);
    } else if (which == 2) {
      y.fetch_or(2, relaxed);
    } else {
      first = y.load(acquire);
      second = x.load(relaxed);
    }
  }
};

TEST_CASE("the checker keeps release sequences") {
  const Outcomes seen = outcomes_of<ReleaseSequence>();
  CHECK(seen.count({3, 0}) == 0);
  CHECK(seen.count({3, 1}) == 1);
  CHECK(seen.count({2, 0}) == 1);
}

/// Four threads: two readers may see two independent stores in different orders.
struct IndependentReads : Litmus {
  static constexpr int threads = 4;
  void thread(int which) {
    if (which == 1) x.store(1, release);
    if (which == 2) y.store(1, release);
    if (which == 3) first = 2 * x.load(acquire) + y.load(acquire);
    if (which == 4) second = 2 * y.load(acquire) + x.load(acquire);
  }
};

TEST_CASE("the checker lets readers disagree about the order of independent stores") {
  CHECK(outcomes_of<IndependentReads>().count({2, 2}) == 1);
}

struct Race : Litmus {
  static constexpr int threads = 2;
  alignas(8) std::byte memory[8] = {};
  Race() { explorer().watch(memory, sizeof memory); }
  void thread(int which) {
    if (which == 1) {
      explorer().write(memory, 1);
      x.store(1, release);
    } else if (x.load(relaxed) == 1) {
      explorer().read(memory);
    }
  }
};

struct NeverWoken : Litmus {
  static constexpr int threads = 1;
  void thread(int) { explorer().sleep(x.location(), 0); }
};

TEST_CASE("the checker reports a race on plain memory, and a sleeper that is never woken") {
  CHECK(explore<Race>(1000).failure == "a read of memory that is not published");
  CHECK(explore<NeverWoken>(1000).failure == "a thread sleeps and is never woken");
}

/// `first`: what the sleeper reads after its sleep; `second`: whether its deadline had passed.
struct SleepingUntil : Litmus {
  static constexpr int threads = 2;
  void thread(int which) {
    constexpr Time deadline{std::chrono::seconds(1)};
    if (which == 1) {
      x.exchange(1, release);
      explorer().wake(x.location());
    } else {
      explorer().sleep_until(x.location(), 0, deadline);
      first = x.fetch_or(0, acquire);
      second = explorer().is_past(deadline) ? 1 : 0;
      if (second == 1 && !explorer().is_past(deadline)) explorer().fail("a deadline that had passed is no longer past");
    }
  }
};

TEST_CASE("the checker ends a sleep with a deadline by a wake-up, the deadline, or another value") {
  // {0, 0} is impossible: before the deadline the sleep ends only by the wake-up or because the value is not 0.
  CHECK(outcomes_of<SleepingUntil>() == Outcomes{{0, 1}, {1, 0}, {1, 1}});
}

/// Thread 1 writes a word of a line and sets a flag, which thread 2 loads, with acquire if `acquires`.
/// With `reads`, thread 2 then reads the word and reports that, before thread 1 prefetches the line for writing.
/// Without `reads`, thread 1 prefetches it for writing at once (`to_write`), or thread 2 prefetches it for reading.
template <bool to_write, bool acquires, bool reads>
struct Prefetching : Litmus {
  static constexpr int threads = 2;
  alignas(16) std::byte memory[16] = {};
  Prefetching() { explorer().watch(memory, sizeof memory); }
  void thread(int which) {
    if (which == 1) {
      explorer().write(memory, 1);
      x.store(1, release);
      if (reads && y.load(acquire) == 1) explorer().prefetch_for_write(memory + 8, 16);
      if (!reads && to_write) explorer().prefetch_for_write(memory + 8, 16);
    } else if (x.load(acquires ? acquire : relaxed) == 1) {
      if (!to_write) explorer().prefetch_for_read(memory);
      if (reads) {
        explorer().read(memory);
        y.store(1, acquires ? release : relaxed);
      }
    }
  }
};

TEST_CASE("the checker reports lines that are prefetched before they are published, or before they are read") {
  CHECK(explore<Prefetching<false, true, false>>(1000).failure.empty());
  CHECK(explore<Prefetching<false, false, false>>(1000).failure == "a prefetched line is not published");
  CHECK(explore<Prefetching<true, true, true>>(1000).failure.empty());
  CHECK(explore<Prefetching<true, true, false>>(1000).failure == "a line prefetched for writing was not read");
}

/// Thread 1 writes a word of a line and sets a flag; thread 2 evicts the line when it sees the flag, with acquire if
/// `acquires`.
template <bool acquires>
struct Evicting : Litmus {
  static constexpr int threads = 2;
  alignas(16) std::byte memory[16] = {};
  Evicting() { explorer().watch(memory, sizeof memory); }
  void thread(int which) {
    if (which == 1) {
      explorer().write(memory, 1);
      x.store(1, release);
    } else if (x.load(acquires ? acquire : relaxed) == 1) {
      explorer().evict(memory + 8, 16);
    }
  }
};

TEST_CASE("the checker reports a line that is evicted while it may still be written") {
  CHECK(explore<Evicting<true>>(1000).failure.empty());
  CHECK(explore<Evicting<false>>(1000).failure == "an evicted line is being written");
}

}  // namespace
}  // namespace ringfence::checker
