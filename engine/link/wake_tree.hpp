#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "link/atomics.hpp"
#include "link/doorbell.hpp"

namespace ringfence::link {

/// Wakes many threads at the cost of a few: the waker rings the first `fan_out` doorbells, and each member that wakes
/// rings those of its children, before it does anything else. So with a fan-out of four a thousand threads are awake
/// after five times the time of four rings, where the waker alone would need a thousand, at 2 to 9 us each.
///
/// No wake-up is lost. A member passes a wave on whenever it finds one that it has not passed on, whoever woke it, and
/// at the latest when its parent has rung it. What the waker did before wake() happens before the store of the wave,
/// the store before its load by a member, and the load before the rings of the children: so the test of each member
/// sees it. The model checker in tests/link runs this code exhaustively.
///
/// A member whose thread has stopped does not pass on. So whoever waits for the members needs a deadline, after which
/// it rings those that are silent itself.
///
/// Threads: one waker; each member's index belongs to the thread that owns its doorbell. The doorbells outlive the
/// tree. Memory: allocated by the constructor.
template <class Policy, std::size_t fan_out>
class BasicWakeTree {
 public:
  using Bell = BasicDoorbell<Policy>;

  /// The doorbells of the members, by index.
  explicit BasicWakeTree(std::span<Bell* const> bells) : bells_(bells.begin(), bells.end()) {}
  BasicWakeTree(const BasicWakeTree&) = delete;
  BasicWakeTree& operator=(const BasicWakeTree&) = delete;

  /// Number of members.
  std::size_t size() const noexcept { return bells_.size(); }
  /// How many members are between the waker and this one: 0 for those that the waker itself rings.
  static constexpr std::size_t level_of(std::size_t member) noexcept {
    std::size_t level = 0;
    for (; member >= fan_out; member = member / fan_out - 1) {
      ++level;
    }
    return level;
  }
  /// Number of rings one after the other, by the waker or by one member.
  static constexpr std::size_t rings_in_turn = fan_out;

  /// By the waker: wakes all members.
  void wake() noexcept {
    if constexpr (Policy::defect == Defect::wave_stored_late) ring_from(0);
    // Pairs with the load in pass_on().
    wave_.store(++last_wave_, order_unless<Policy>(Defect::wave_unordered, std::memory_order_release));
    if constexpr (Policy::defect != Defect::wave_stored_late) ring_from(0);
  }
  /// By a member, each time before it tests its condition. `passed` belongs to the member and starts at 0.
  void pass_on(std::size_t member, std::uint32_t& passed) noexcept {
    // Pairs with the store in wake(): the children see all that was done before.
    const std::uint32_t wave = wave_.load(order_unless<Policy>(Defect::wave_peek_unordered, std::memory_order_acquire));
    if (wave != passed) [[unlikely]] {
      passed = wave;
      ring_from((member + 1) * fan_out);
    }
  }

 private:
  void ring_from(std::size_t first) noexcept {
    for (std::size_t i = first; i < first + fan_out && i < bells_.size(); ++i) {
      bells_[i]->ring();
    }
  }

  const std::vector<Bell*> bells_;
  std::uint32_t last_wave_ = 0;  ///< used by the waker only
  /// Number of the last call of wake(). On lines of its own: all members read it.
  alignas(cache_line_pair_bytes) typename Policy::template Atomic<std::uint32_t> wave_{0};
};

/// A tree of threads of one process. With a fan-out of 4 the last of 1024 threads is rung after 20 rings in turn; with
/// 8 after 32, and with 2 also after 20, but twice as many threads have to wake in turn.
class WakeTree : public BasicWakeTree<ThreadAtomics, 4> {
 public:
  using BasicWakeTree::BasicWakeTree;
};

}  // namespace ringfence::link
