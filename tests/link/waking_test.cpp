// Proves WakeTree and Gathering: each small program below runs in every schedule and with every store that a load may
// see. For each seeded defect, one of the programs must fail.
#include <cstddef>
#include <cstdint>
#include <string>
#include <type_traits>
#include <vector>

#include <doctest/doctest.h>

#include "link/checker.hpp"
#include "link/doorbell.hpp"
#include "link/gathering.hpp"
#include "link/wake_tree.hpp"

namespace ringfence::checker {
namespace {

using link::Defect;

/// One thread notifies each member of a chain, or of a tree in which it rings two of three members, that it may
/// continue. A member may find that out before its parent rings it, and must nevertheless pass the wave on.
template <class Policy, std::size_t waker_rings, int members>
struct Waking {
  static constexpr int threads = 1 + members;
  using Tree = link::BasicWakeTree<Policy>;
  using Bell = link::BasicDoorbell<Policy>;

  Bell bells[members];
  Bell* pointers[members];
  Atomic<std::uint32_t> notified[3]{{0}, {0}, {0}};
  Tree tree{std::span<Bell* const>(fill()), waker_rings};
  int awake = 0;

  std::span<Bell* const> fill() {
    for (int i = 0; i < members; ++i) pointers[i] = &bells[i];
    return pointers;
  }
  void thread(int which) {
    if (which == 1) {
      for (int i = 0; i < members; ++i) notified[i].store(1, std::memory_order_release);
      tree.wake();
      return;
    }
    const auto member = static_cast<std::size_t>(which - 2);
    std::uint32_t passed = 0;
    bells[member].wait([&] {
      tree.pass_on(member, passed);
      return passed != 0 && notified[member].load(std::memory_order_acquire) != 0;
    });
    ++awake;
  }
  void finish() {
    if (awake != members) explorer().fail("a member was not woken");
  }
};

/// Two members arrive, and the one that finds that none is missing wakes the thread that waits for what both have done.
template <class Policy>
struct Arriving {
  static constexpr int threads = 3;

  link::BasicDoorbell<Policy> bell;
  link::BasicGathering<Policy> gathering;
  Atomic<std::uint32_t> done[2]{{0}, {0}};
  bool gathered = false;

  Arriving() { gathering.expect(3); }
  void thread(int which) {
    if (which == 3) {
      bell.wait(
          [&] { return done[0].load(std::memory_order_acquire) != 0 && done[1].load(std::memory_order_acquire) != 0; });
      gathered = true;
      return;
    }
    const auto member = static_cast<unsigned>(which - 1);
    done[member].store(1, std::memory_order_release);
    if (gathering.arrive(member)) bell.ring();
  }
  void finish() {
    if (!gathered) explorer().fail("no thread was woken");
  }
};

/// Two groups of one member each: the last member of a group arrives for the group, and the last group wakes the thread
/// that waits. This one looks at the groups.
template <class Policy>
struct ArrivingInGroups {
  static constexpr int threads = 3;

  link::BasicDoorbell<Policy> bell;
  link::BasicGathering<Policy> groups[2], all;
  Atomic<std::uint32_t> done{0};  // by the first member
  bool gathered = false, complete = false;

  ArrivingInGroups() {
    for (auto& group : groups) group.expect(1);
    all.expect(3);
  }
  void thread(int which) {
    if (which == 3) {
      bell.wait([&] { return groups[0].arrived() != 0 && groups[1].arrived() != 0; });
      gathered = true;
      complete = done.load(std::memory_order_relaxed) != 0;
      return;
    }
    const auto member = static_cast<unsigned>(which - 1);
    if (member == 0) done.store(1, std::memory_order_relaxed);
    if (groups[member].arrive(0) && all.arrive(member)) bell.ring();
  }
  void finish() {
    if (!gathered) explorer().fail("no thread was woken");
    if (!complete) explorer().fail("what a member did before is not visible");
  }
};

/// The thread that waits sees in any order who has arrived, and then also what these members have done. The second
/// member arrives after the waiting thread has asked to be woken for each.
template <class Policy>
struct Looking {
  static constexpr int threads = 3;

  link::BasicDoorbell<Policy> bell;
  link::BasicGathering<Policy> gathering;
  Atomic<std::uint32_t> done[2]{{0}, {0}};
  bool complete = true;

  Looking() { gathering.expect(7); }  // the third member never arrives
  void thread(int which) {
    if (which == 3) {
      gathering.wake_for_each();
      const std::uint64_t arrived = gathering.arrived();
      for (unsigned member = 0; member < 2; ++member) {
        if ((arrived >> member & 1) != 0) complete &= done[member].load(std::memory_order_relaxed) != 0;
      }
      return;
    }
    const auto member = static_cast<unsigned>(which - 1);
    done[member].store(1, std::memory_order_relaxed);
    if (gathering.arrive(member)) bell.ring();
  }
  void finish() {
    if (!complete) explorer().fail("a member has arrived, and what it did before is not visible");
  }
};

constexpr std::uint64_t max_executions = 20'000'000;

/// The failure that the programs find in one version of the code; empty if there is none.
template <Defect defect>
std::string explore_all(std::uint64_t& executions) {
  using Policy = CheckedAtomics<defect>;
  std::string failure;
  const auto next = [&]<class Program>(const char* name, std::type_identity<Program>) {
    if (!failure.empty()) return;
    const Report report = explore<Program>(max_executions);
    executions += report.executions;
    if (!report.failure.empty()) {
      failure = std::string(name) + ": " + report.failure + "\n" + report.trace;
    } else if (!report.exhausted) {
      failure = std::string(name) + " is too large to explore";
    }
  };
  next("arriving", std::type_identity<Arriving<Policy>>());
  next("arriving in groups", std::type_identity<ArrivingInGroups<Policy>>());
  next("looking", std::type_identity<Looking<Policy>>());
  next("a chain of two", std::type_identity<Waking<Policy, 1, 2>>());
  next("a tree of three", std::type_identity<Waking<Policy, 2, 3>>());
  return failure;
}

TEST_CASE("wake tree and gathering hold in every execution of the small programs") {
  std::uint64_t executions = 0;
  const std::string failure = explore_all<Defect::none>(executions);
  CHECK_MESSAGE(failure.empty(), failure);
  MESSAGE(executions << " executions passed");
}

template <Defect defect>
void expect_found() {
  std::uint64_t executions = 0;
  CHECK_MESSAGE(!explore_all<defect>(executions).empty(),
                "defect " << static_cast<int>(defect) << " survived " << executions << " executions");
}

TEST_CASE("every seeded defect of wake tree and gathering is found") {
  expect_found<Defect::wave_unordered>();
  expect_found<Defect::wave_peek_unordered>();
  expect_found<Defect::wave_stored_late>();
  expect_found<Defect::arrival_unordered>();
  expect_found<Defect::arrived_unordered>();
}

}  // namespace
}  // namespace ringfence::checker
