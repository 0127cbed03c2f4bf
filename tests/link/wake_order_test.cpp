#include "link/wake_order.hpp"

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include <doctest/doctest.h>

namespace ringfence::link {
namespace {

/// When each member is rung, in steps: each ring takes one, and to wake another one. Fails unless each is rung once, by
/// the waker or by a member that is rung itself.
std::vector<std::size_t> steps_of(const WakeOrder& order) {
  std::vector<std::size_t> steps(order.children.size(), 0);
  std::vector<std::uint32_t> awake;
  const auto ring = [&](const WakeOrder::Children& children, std::size_t begin) {
    for (const std::uint32_t member : std::span(order.rung).subspan(children.first, children.count)) {
      REQUIRE(steps.at(member) == 0);
      steps[member] = ++begin;
      awake.push_back(member);
    }
  };
  ring(order.waker, 0);
  for (std::size_t i = 0; i < awake.size(); ++i) {
    ring(order.children[awake[i]], steps[awake[i]] + 1);
  }
  REQUIRE(awake.size() == order.children.size());
  return steps;
}

/// How many threads can be rung within some steps after one was rung, with itself: what it rings k-th is rung k + 1
/// steps later.
std::size_t most_below(std::size_t steps) {
  std::size_t most = 1;
  for (std::size_t k = 1; k + 1 <= steps; ++k) {
    most += most_below(steps - k - 1);
  }
  return most;
}

/// The least number of steps in which a waker with so many rings can have all members rung.
std::size_t least_steps(std::size_t members, std::size_t waker_rings) {
  for (std::size_t steps = 1;; ++steps) {
    std::size_t most = 0;
    for (std::size_t k = 1; k <= std::min(steps, waker_rings); ++k) {
      most += most_below(steps - k);
    }
    if (most >= members) {
      return steps;
    }
  }
}

}  // namespace

TEST_CASE(
    "a wake order rings each member once, in the least number of steps, and the waker rings no more than it may") {
  for (const std::size_t waker_rings : {1, 2, 4, 7}) {
    for (const std::size_t members : {1, 2, 3, 4, 5, 16, 17, 63, 64, 100, 256, 1000, 1024}) {
      INFO(members, " members, ", waker_rings, " rings by the waker");
      const WakeOrder order(members, waker_rings);
      const std::vector<std::size_t> steps = steps_of(order);
      CHECK(order.waker.count <= waker_rings);
      CHECK(*std::max_element(steps.begin(), steps.end()) == least_steps(members, waker_rings));
    }
  }
  CHECK(WakeOrder(0, 4).rung.empty());
}

TEST_CASE("rings in turn are those above a member, and its own") {
  // The waker rings 0 and 1; 0 rings 2 and 3; 1 rings 4.
  const WakeOrder order(5, 2);
  CHECK(order.rung == std::vector<std::uint32_t>{0, 1, 2, 3, 4});
  CHECK(order.rings_in_turn == std::vector<std::uint32_t>{3, 3, 2, 3, 3});
  const WakeOrder many(1024, 4);
  CHECK(*std::max_element(many.rings_in_turn.begin(), many.rings_in_turn.end()) == 14);
}

}  // namespace ringfence::link
