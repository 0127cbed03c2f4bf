#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

namespace ringfence::link {

/// Who rings whom in a WakeTree, so that all members are awake soon: in each step, of the length of one ring, every
/// thread that is awake rings one more member. A member that is rung begins to ring after one more step, in which it
/// wakes; so those that wake first have the most children.
///
/// Method: the fastest broadcast in the LogP model (Karp, Sahay, Santos, Schauser, "Optimal Broadcast and Summation in
/// the LogP Model", 1993), except that the waker rings at most `waker_rings` members: others wait for what it does
/// next.
struct WakeOrder {
  /// Positions in `rung`.
  struct Children {
    std::uint32_t first = 0;
    std::uint32_t count = 0;
  };
  Children waker;
  std::vector<Children> children;   ///< by member
  std::vector<std::uint32_t> rung;  ///< the members, in the order of who rings them, and when: each once
  /// By member: number of rings one after the other, by the waker and by members, until this one has been rung and has
  /// rung its children.
  std::vector<std::uint32_t> rings_in_turn;

  /// Precondition: `waker_rings` is at least 1.
  WakeOrder(std::size_t members, std::size_t waker_rings);
};

}  // namespace ringfence::link
