#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "link/atomics.hpp"
#include "link/doorbell.hpp"
#include "link/wake_order.hpp"

namespace ringfence::link {

/// Wakes many threads at the cost of a few: the waker rings a few doorbells, and each member that wakes rings its
/// children (WakeOrder), before it does anything else. So a thousand threads are awake after 14 rings in turn, where
/// the waker alone would need a thousand, at 2 to 9 us each.
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
template <class Policy>
class BasicWakeTree {
 public:
  using Bell = BasicDoorbell<Policy>;
  static constexpr std::size_t usual_waker_rings = 4;

  /// The doorbells of the members, by index. `waker_rings`: see WakeOrder.
  explicit BasicWakeTree(std::span<Bell* const> bells, std::size_t waker_rings = usual_waker_rings)
      : order_(bells.size(), waker_rings) {
    for (const std::uint32_t member : order_.rung) {
      rung_.push_back(bells[member]);
    }
  }
  BasicWakeTree(const BasicWakeTree&) = delete;
  BasicWakeTree& operator=(const BasicWakeTree&) = delete;

  /// Who rings whom.
  const WakeOrder& order() const noexcept { return order_; }

  /// By the waker: wakes all members.
  void wake() noexcept {
    if constexpr (Policy::defect == Defect::wave_stored_late) ring(order_.waker);
    // Pairs with the load in pass_on().
    wave_.store(++last_wave_, order_unless<Policy>(Defect::wave_unordered, std::memory_order_release));
    if constexpr (Policy::defect != Defect::wave_stored_late) ring(order_.waker);
  }
  /// By a member, each time before it tests its condition. `passed` belongs to the member and starts at 0.
  void pass_on(std::size_t member, std::uint32_t& passed) noexcept {
    // Pairs with the store in wake(): the children see all that was done before.
    const std::uint32_t wave = wave_.load(order_unless<Policy>(Defect::wave_peek_unordered, std::memory_order_acquire));
    if (wave != passed) [[unlikely]] {
      passed = wave;
      ring(order_.children[member]);
    }
  }

 private:
  void ring(const WakeOrder::Children& children) noexcept {
    for (std::uint32_t i = 0; i < children.count; ++i) {
      rung_[children.first + i]->ring();
    }
  }

  const WakeOrder order_;
  std::vector<Bell*> rung_;      ///< parallel to WakeOrder::rung
  std::uint32_t last_wave_ = 0;  ///< used by the waker only
  /// Number of the last call of wake(). On lines of its own: all members read it.
  alignas(cache_line_pair_bytes) typename Policy::template Atomic<std::uint32_t> wave_{0};
};

/// A tree of threads of one process.
class WakeTree : public BasicWakeTree<ThreadAtomics> {
 public:
  using BasicWakeTree::BasicWakeTree;
};

}  // namespace ringfence::link
