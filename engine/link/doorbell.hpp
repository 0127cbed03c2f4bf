#pragma once

#include <atomic>
#include <chrono>
#include <cstdint>
#include <optional>

#include "link/atomics.hpp"

namespace ringfence::link {

/// What a thread sleeps on: one a thread, not one a ring. Whoever may have made something ready rings it.
///
/// The owner waits for a condition that it can look at itself ("a message is there, or room"); a ring only says that
/// looking again is worth while. Rings are not counted, and a wait may find its condition met without one.
///
/// No wake-up is lost. All that is ever done to the state is an exchange, so that ringer and sleeper are ordered by the
/// one word: either the ringer's exchange comes later, finds `asleep` and wakes; or the sleeper's comes later, and as
/// it acquires what the ringer released, the look that follows it sees what the ringer did before. No fence is needed,
/// and no sequential consistency. The exhaustive checker in tests/link runs this code.
///
/// Cost: a ring that wakes nobody is one atomic exchange. Waiting looks for a while (see Patience), then sleeps on a
/// futex: a round trip between two threads that both sleep takes about 40 us.
///
/// Threads: `ring` from any, `wait` from the owner alone. Memory: none but itself; may lie in shared memory with
/// ProcessAtomics.
template <class Policy>
class alignas(cache_line_pair_bytes) BasicDoorbell {
 public:
  BasicDoorbell() noexcept { Policy::add_waiting_thread(); }
  /// Looks for as long as `patience` says, however many threads there are.
  explicit BasicDoorbell(SpinPolicy spin_policy) noexcept : spin_policy_(spin_policy) { Policy::add_waiting_thread(); }
  ~BasicDoorbell() { Policy::remove_waiting_thread(); }
  BasicDoorbell(const BasicDoorbell&) = delete;
  BasicDoorbell& operator=(const BasicDoorbell&) = delete;

  /// What the caller did before is seen by the owner when it next looks; it is woken if it sleeps.
  void ring() noexcept {
    // Pairs with the owner's exchange in arm.
    const std::uint32_t before =
        state_.exchange(rung, order_unless<Policy>(Defect::ring_unordered, std::memory_order_release));
    if (before == asleep) Policy::wake(state_);
  }

  /// Returns when `ready()` is true. It is called again and again, from this thread; it may act. Where there are more
  /// threads than cores it is called between the first look and the last before sleeping only when somebody has rung.
  template <class Ready>
  void wait(Ready ready) noexcept {
    if (look(ready)) return;
    while (!arm(ready)) Policy::sleep(state_, asleep);
  }

  /// The same, but gives up at `deadline`. Returns whether `ready()` was true.
  template <class Ready>
  bool wait_until(Ready ready, std::chrono::steady_clock::time_point deadline) noexcept {
    if (look(ready)) return true;
    while (!arm(ready)) {
      if (Policy::defect != Defect::deadline_not_checked && Policy::is_past(deadline)) {
        disarm();
        return Policy::defect == Defect::timeout_reported_as_ready || ready();
      }
      if constexpr (Policy::defect == Defect::deadline_not_set) {
        Policy::sleep(state_, asleep);
      } else {
        Policy::sleep_until(state_, asleep, deadline);
      }
    }
    return true;
  }

  /// The same, but gives up after `duration`.
  template <class Ready>
  bool wait_for(Ready ready, std::chrono::nanoseconds duration) noexcept {
    return wait_until(ready, std::chrono::steady_clock::now() + duration);
  }

 private:
  enum State : std::uint32_t { awake, asleep, rung };

  /// Looks without sleeping.
  template <class Ready>
  bool look(Ready& ready) noexcept {
    const SpinPolicy spin_policy = spin_policy_ ? *spin_policy_ : Policy::spin_policy();
    for (std::uint32_t i = 0; i < spin_policy.immediate_polls; ++i) {
      if (ready()) return true;
    }
    if (spin_policy.poll_only_after_ring && ready()) return true;
    for (std::uint32_t i = 0; i < spin_policy.pause_polls; ++i) {
      if ((!spin_policy.poll_only_after_ring || has_rung()) && ready()) return true;
      Policy::pause();
    }
    for (std::uint32_t i = 0; i < spin_policy.yield_polls; ++i) {
      if ((!spin_policy.poll_only_after_ring || has_rung()) && ready()) return true;
      Policy::yield();
    }
    return false;
  }

  /// Whether somebody has rung since this was last asked. What he did before is seen then.
  bool has_rung() noexcept {
    if (state_.load(std::memory_order_relaxed) != rung) return false;
    if constexpr (Policy::defect == Defect::ring_cleared_by_store) {
      state_.store(awake, std::memory_order_relaxed);
    } else {
      // Pairs with ring, as in arm; an exchange for the reason that disarm has.
      state_.exchange(awake, std::memory_order_acquire);
    }
    return true;
  }

  /// Says that the owner sleeps and looks once more. True when it need not sleep after all.
  template <class Ready>
  bool arm(Ready& ready) noexcept {
    if constexpr (Policy::defect == Defect::flag_set_late) {
      if (ready()) return true;
    }
    // Pairs with ring: what was done before a ring that this exchange overwrites is seen by the look below.
    state_.exchange(asleep, order_unless<Policy>(Defect::arm_unordered, std::memory_order_acquire));
    if constexpr (Policy::defect == Defect::flag_set_late || Policy::defect == Defect::no_recheck) return false;
    if (!ready()) return false;
    disarm();
    return true;
  }

  /// Takes back that the owner sleeps, so that nobody makes a system call for it.
  void disarm() noexcept {
    if constexpr (Policy::defect == Defect::disarm_by_store) {
      state_.store(awake, std::memory_order_relaxed);
    } else {
      // An exchange, not a store: it hands on what a ring that it overwrites has released, for the next arm to acquire.
      state_.exchange(awake, std::memory_order_relaxed);
    }
  }

  typename Policy::template Atomic<std::uint32_t> state_{awake};
  // Read at each wait: on the line of the state it would take that away from who rings.
  alignas(cache_line_pair_bytes) std::optional<SpinPolicy> spin_policy_;
};

/// The doorbell of a thread.
class Doorbell : public BasicDoorbell<ThreadAtomics> {
 public:
  using BasicDoorbell::BasicDoorbell;
};

/// The doorbell of a process, in shared memory.
class ProcessDoorbell : public BasicDoorbell<ProcessAtomics> {
 public:
  using BasicDoorbell::BasicDoorbell;
};

}  // namespace ringfence::link
