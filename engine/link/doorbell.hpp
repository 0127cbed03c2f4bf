#pragma once

#include <atomic>
#include <chrono>
#include <cstdint>
#include <optional>

#include "link/atomics.hpp"
#include "link/descriptor_sleeper.hpp"

namespace ringfence::link {

/// Sleeps and wakes as the policy does.
template <class Policy>
struct PolicySleeper {
  template <class Word>
  static void sleep(const Word& word, std::uint32_t expected) {
    Policy::sleep(word, expected);
  }
  template <class Word>
  static void sleep_until(const Word& word, std::uint32_t expected, std::chrono::steady_clock::time_point deadline) {
    Policy::sleep_until(word, expected, deadline);
  }
  template <class Word>
  static void wake(const Word& word) {
    Policy::wake(word);
  }
};

/// How the owner of a doorbell with that policy sleeps.
template <class Policy>
struct SleeperOf {
  using Type = PolicySleeper<Policy>;
};
template <>
struct SleeperOf<ThreadAtomics> {
  using Type = DescriptorSleeper;
};

/// A thread waits on its doorbell for a condition; other threads ring it when they may have made the condition true.
/// Each thread has one doorbell, not one per ring.
///
/// The owner tests its condition itself (for example "a message or room is available"); a ring only means that testing
/// again is worth while. Rings are not counted, and a wait may find its condition true without a ring.
///
/// No wake-up is lost. Every change of the state is an exchange, so rings and sleeps are ordered by this one word. If a
/// ring's exchange comes after the owner's, it finds `asleep` and wakes the owner. If the owner's exchange comes later,
/// it acquires what the ring released, and the test that follows sees what the ringing thread did before. This needs
/// neither fences nor sequential consistency. The model checker in tests/link runs this code exhaustively.
///
/// Cost: a ring that wakes no thread is one atomic exchange. A wait polls for a while (see SpinPolicy), then sleeps on
/// a futex. A round trip between two threads that both sleep takes about 40 us; so a thread polls for a time of this
/// order before it sleeps, if no other thread wants its core.
///
/// Threads: any thread may call `ring`; only the owner may call the waits. Memory: allocates nothing; with
/// ProcessAtomics it may lie in shared memory.
template <class Policy>
class alignas(cache_line_pair_bytes) BasicDoorbell {
 public:
  BasicDoorbell() noexcept { Policy::add_waiting_thread(); }
  /// Polls as `policy` says, whatever the number of threads.
  explicit BasicDoorbell(SpinPolicy policy) noexcept : spin_policy_(policy) { Policy::add_waiting_thread(); }
  ~BasicDoorbell() { Policy::remove_waiting_thread(); }
  BasicDoorbell(const BasicDoorbell&) = delete;
  BasicDoorbell& operator=(const BasicDoorbell&) = delete;

  /// Wakes the owner if it sleeps. What the caller did before is visible to the owner's next test of its condition.
  void ring() noexcept {
    // Pairs with the owner's exchange in arm().
    const std::uint32_t before =
        state_.exchange(rung, order_unless<Policy>(Defect::ring_unordered, std::memory_order_release));
    if (before == asleep) sleeper_.wake(state_);
  }

  /// Returns when `ready()` is true. `ready` is called repeatedly, from this thread, and may have side effects. If
  /// there are more threads than cores, it is called only after a ring, except for the first test and the last one
  /// before each sleep.
  template <class Ready>
  void wait(Ready ready) noexcept {
    if (poll(ready)) return;
    while (!arm(ready)) sleeper_.sleep(state_, asleep);
  }

  /// Like wait(), but gives up at `deadline`. Returns whether `ready()` was true.
  template <class Ready>
  bool wait_until(Ready ready, std::chrono::steady_clock::time_point deadline) noexcept {
    if (poll(ready)) return true;
    while (!arm(ready)) {
      if (Policy::defect != Defect::deadline_not_checked && Policy::is_past(deadline)) {
        disarm();
        return Policy::defect == Defect::timeout_reported_as_ready || ready();
      }
      if constexpr (Policy::defect == Defect::deadline_not_set) {
        sleeper_.sleep(state_, asleep);
      } else {
        sleeper_.sleep_until(state_, asleep, deadline);
      }
    }
    return true;
  }

  /// Like wait_until(), with the deadline `duration` from now.
  template <class Ready>
  bool wait_for(Ready ready, std::chrono::nanoseconds duration) noexcept {
    return wait_until(ready, std::chrono::steady_clock::now() + duration);
  }

 private:
  enum State : std::uint32_t { awake, asleep, rung };

  /// Polls without sleeping. Returns whether `ready()` was true.
  template <class Ready>
  bool poll(Ready& ready) noexcept {
    const SpinPolicy policy = spin_policy_ ? *spin_policy_ : Policy::spin_policy();
    for (std::uint32_t i = 0; i < policy.immediate_polls; ++i) {
      if (ready()) return true;
    }
    if (policy.poll_only_after_ring && ready()) return true;
    for (std::uint32_t i = 0; i < policy.pause_polls; ++i) {
      if ((!policy.poll_only_after_ring || has_rung()) && ready()) return true;
      Policy::pause();
    }
    return poll_with_yields(policy, ready);
  }

  /// The last polls before a sleep. The condition may do any work, so the end of the yields is noted before it is
  /// tested.
  template <class Ready>
  bool poll_with_yields(const SpinPolicy& policy, Ready& ready) noexcept {
    std::uint32_t yields = policy.yield_polls, idle_yields = policy.idle_yields;
    while (yields > 0) {
      if (!policy.poll_only_after_ring || has_rung()) {
        Policy::end_yields();
        if (ready()) return true;
      }
      const bool is_idle = !Policy::yield() && idle_yields > 0;
      --(is_idle ? idle_yields : yields);
    }
    Policy::end_yields();
    return false;
  }

  /// Whether a ring arrived since the last call; clears it. What the ringing thread did before is then visible.
  bool has_rung() noexcept {
    if (state_.load(std::memory_order_relaxed) != rung) return false;
    if constexpr (Policy::defect == Defect::ring_cleared_by_store) {
      state_.store(awake, std::memory_order_relaxed);
    } else {
      // Pairs with ring(), as in arm(). An exchange for the same reason as in disarm().
      state_.exchange(awake, std::memory_order_acquire);
    }
    return true;
  }

  /// Sets `asleep` and tests the condition once more. Returns true if the owner need not sleep.
  template <class Ready>
  bool arm(Ready& ready) noexcept {
    if constexpr (Policy::defect == Defect::flag_set_late) {
      if (ready()) return true;
    }
    // Pairs with ring(): the test below sees what was done before any ring that this exchange overwrites.
    state_.exchange(asleep, order_unless<Policy>(Defect::arm_unordered, std::memory_order_acquire));
    if constexpr (Policy::defect == Defect::flag_set_late || Policy::defect == Defect::no_recheck) return false;
    if (!ready()) return false;
    disarm();
    return true;
  }

  /// Clears `asleep`, so that a ring makes no system call.
  void disarm() noexcept {
    if constexpr (Policy::defect == Defect::disarm_by_store) {
      state_.store(awake, std::memory_order_relaxed);
    } else {
      // An exchange, not a store: it continues the release sequence of a ring that it overwrites, for the next arm() to
      // acquire.
      state_.exchange(awake, std::memory_order_relaxed);
    }
  }

  typename Policy::template Atomic<std::uint32_t> state_{awake};

 protected:
  // On a line of its own: the owner reads it at each wait, which would take the line of `state_` from ringing threads.
  alignas(cache_line_pair_bytes) std::optional<SpinPolicy> spin_policy_;
  [[no_unique_address]] typename SleeperOf<Policy>::Type sleeper_;
};

/// The doorbell of a thread, for rings from the same process, and for what the thread reads from sockets.
class Doorbell : public BasicDoorbell<ThreadAtomics> {
 public:
  using BasicDoorbell::BasicDoorbell;

  /// Lets the owner watch a file descriptor; see DescriptorSleeper::prepare(). From then on the owner polls only
  /// briefly before it sleeps, because its condition then tests the descriptor by a system call.
  [[nodiscard]] bool prepare_to_watch() noexcept {
    spin_policy_ = SpinPolicy{.yield_polls = 2};
    return sleeper_.prepare();
  }
  /// See DescriptorSleeper::watch().
  void watch(int descriptor) noexcept { sleeper_.watch(descriptor); }
};

/// A doorbell in shared memory, for rings from other processes.
class ProcessDoorbell : public BasicDoorbell<ProcessAtomics> {
 public:
  using BasicDoorbell::BasicDoorbell;
};

}  // namespace ringfence::link
