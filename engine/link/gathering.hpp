#pragma once

#include <cstdint>

#include "link/atomics.hpp"

namespace ringfence::link {

/// Up to 64 threads that arrive, of which the last one wakes a thread that waits for all: so that thread is woken once,
/// not once for each.
///
/// What each member did before arrive() is visible to whoever the last one wakes: the arrivals are read-modify-writes
/// of one word, so the last one acquires what all others released. The model checker in tests/link runs this code
/// exhaustively.
///
/// Threads: expect() belongs to the thread that waits; any thread may arrive. Memory: allocates nothing.
template <class Policy>
class alignas(cache_line_pair_bytes) BasicGathering {
 public:
  /// By the thread that waits, before any of these members may arrive: forgets all arrivals. `members`: one bit each.
  void expect(std::uint64_t members) noexcept {
    expected_.store(members, std::memory_order_relaxed);
    arrived_.store(0, std::memory_order_relaxed);
  }
  /// By a member, 0 to 63, after it has learnt that it is expected. Returns whether no expected member is missing; then
  /// the caller wakes the thread that waits. A member may arrive more than once, and one that is not expected, too.
  [[nodiscard]] bool arrive(unsigned member) noexcept {
    const std::uint64_t bit = std::uint64_t{1} << member;
    const std::uint64_t before =
        arrived_.fetch_or(bit, order_unless<Policy>(Defect::arrival_unordered, std::memory_order_acq_rel));
    return (expected_.load(std::memory_order_relaxed) & ~(before | bit)) == 0;
  }
  /// By the thread that waits: from now on every member that arrives wakes it; those that have arrived stay arrived. A
  /// read-modify-write, which later loads of this thread do not overtake on x86: so it finds a member that has not seen
  /// this yet if it then looks for itself.
  void wake_for_each() noexcept { expected_.exchange(0, std::memory_order_acq_rel); }
  /// By the thread that waits: who has arrived, one bit each. What these members did before is visible.
  std::uint64_t arrived() const noexcept {
    return arrived_.load(order_unless<Policy>(Defect::arrived_unordered, std::memory_order_acquire));
  }

 private:
  typename Policy::template Atomic<std::uint64_t> arrived_{0};
  typename Policy::template Atomic<std::uint64_t> expected_{0};
};

class Gathering : public BasicGathering<ThreadAtomics> {};

}  // namespace ringfence::link
