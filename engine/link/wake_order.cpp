#include "link/wake_order.hpp"

#include <functional>
#include <queue>
#include <tuple>

namespace ringfence::link {
namespace {

/// A ring, or the time that a thread takes to wake: the unit of the steps.
constexpr std::size_t steps_to_ring = 1, steps_to_wake = 1;

/// A thread that can ring: when its next ring is done, and its number. The waker has the number of members.
using Ringer = std::tuple<std::size_t, std::uint32_t>;

}  // namespace

WakeOrder::WakeOrder(std::size_t members, std::size_t waker_rings)
    : children(members), rung(members), rings_in_turn(members) {
  const auto waker_number = static_cast<std::uint32_t>(members);
  const auto children_of = [&](std::uint32_t parent) -> Children& {
    return parent == waker_number ? waker : children[parent];
  };
  std::vector<std::uint32_t> parents(members), turns(members);  // which of its parent's children a member is
  std::priority_queue<Ringer, std::vector<Ringer>, std::greater<>> ringers;
  ringers.emplace(steps_to_ring, waker_number);
  for (std::uint32_t member = 0; member < members; ++member) {
    const auto [step, parent] = ringers.top();
    ringers.pop();
    parents[member] = parent;
    turns[member] = children_of(parent).count++;
    rings_in_turn[member] = (parent == waker_number ? 0 : rings_in_turn[parent]) + turns[member] + 1;
    if (parent != waker_number || waker.count < waker_rings) {
      ringers.emplace(step + steps_to_ring, parent);
    }
    ringers.emplace(step + steps_to_wake + steps_to_ring, member);
  }
  std::uint32_t next = waker.count;
  for (std::size_t member = 0; member < members; ++member) {
    children[member].first = next;
    next += children[member].count;
    rings_in_turn[member] += children[member].count;
  }
  for (std::uint32_t member = 0; member < members; ++member) {
    rung[children_of(parents[member]).first + turns[member]] = member;
  }
}

}  // namespace ringfence::link
