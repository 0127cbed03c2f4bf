#pragma once

#include <atomic>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <thread>
#include <vector>

#include "facade/threads/steppable.hpp"
#include "link/cores.hpp"
#include "link/doorbell.hpp"
#include "link/wake_tree.hpp"

namespace ringfence::facade {

/// Set when a role of the World has run out of memory. From then on no thread steps any role, and no frame completes.
///
/// Threads: any. Each World has one, which outlives its threads.
class Halt {
 public:
  /// `caller` is the doorbell that set() rings, of the thread that calls World; null if that thread steps all roles.
  explicit Halt(link::Doorbell* caller) noexcept : caller_(caller) {}
  void set() noexcept {
    set_.store(true, std::memory_order_release);
    if (caller_ != nullptr) {
      caller_->ring();
    }
  }
  bool is_set() const noexcept { return set_.load(std::memory_order_acquire); }

 private:
  link::Doorbell* caller_;
  std::atomic<bool> set_{false};
};

/// A thread that steps its roles and sleeps on its doorbell when none of them progresses. It computes in the default
/// floating-point environment.
///
/// Threads: the facade's thread calls all functions; any thread may ring the doorbell. A new list of roles is passed to
/// the thread through one atomic pointer, without a lock.
class Worker {
 public:
  /// Value of `pin_to` in start() for a thread that may run on any core.
  static constexpr std::size_t unpinned = ~std::size_t{0};

  Worker() = default;
  /// Stops and joins the thread; the roles' channels must still exist.
  ~Worker();
  Worker(const Worker&) = delete;
  Worker& operator=(const Worker&) = delete;

  /// The doorbell on which the thread sleeps.
  link::Doorbell& bell() noexcept { return bell_; }
  /// Starts the thread, without roles. Returns false if the system cannot create a thread.
  ///
  /// The thread sets `halt` when a role runs out of memory, and steps no role while it is set. The thread is pinned to
  /// hardware thread `pin_to` of `cores`, unless `cores` is null or `pin_to` is `unpinned`. `tick` is the longest time
  /// between two steps of the roles when no bell rings; 0: roles are stepped only when a bell rings. `halt` and `cores`
  /// outlive the thread.
  [[nodiscard]] bool start(Halt& halt, const link::Cores* cores, std::size_t pin_to,
                           std::chrono::nanoseconds tick = {});
  /// A member of a wake tree: the thread passes waves on before it steps its roles.
  struct TreeMember {
    std::shared_ptr<link::WakeTree> tree;
    std::size_t index = 0;
  };

  /// Replaces the roles of the thread between two steps. Blocks until the thread no longer accesses the old roles, if
  /// there were any. Precondition: the thread was started, is not dismissed, and does not stop inside a step.
  void assign(std::vector<Steppable> roles);
  /// Also replaces its place in a wake tree; no tree: it has none.
  void assign(std::vector<Steppable> roles, TreeMember member);
  /// Requests that the thread ends, and does not wait for it: the thread may have stopped inside a step. It steps no
  /// role any more when has_ended() returns true.
  void dismiss() noexcept;
  /// Waits for the thread to end. Precondition: it was dismissed, and everything that its roles use still exists.
  void join() noexcept;
  /// Whether the thread has ended. After true, the effects of its roles are visible.
  bool has_ended() const noexcept { return ended_.load(std::memory_order_acquire); }
  /// CPU time of the thread without polls (telemetry::working_cpu_ns), nanoseconds; 0 before start() and after join().
  /// A wait that has not ended counts, and does not once it has ended.
  std::uint64_t working_cpu_ns() noexcept;

 private:
  struct Assignment {
    std::vector<Steppable> roles;
    std::optional<TreeMember> member;
  };

  void hand(std::unique_ptr<Assignment> assignment);
  void run(std::chrono::nanoseconds tick);
  bool take_assignment();
  bool step_all();

  link::Doorbell bell_;
  link::Doorbell taken_bell_;  ///< rung when the thread has taken an assignment
  std::atomic<Assignment*> next_{nullptr};
  std::atomic<bool> stop_{false};
  std::atomic<bool> ended_{false};
  std::atomic<std::uint64_t> polled_cpu_ns_{0};  ///< telemetry::polled_cpu_ns of the thread, after its last wait
  Halt* halt_ = nullptr;
  bool steps_roles_ = false;  ///< as last assigned
  // Accessed by the thread only.
  std::vector<Steppable> roles_;
  TreeMember member_;
  std::uint32_t passed_wave_ = 0;  ///< the last one that the thread has passed on
  std::thread thread_;
};

}  // namespace ringfence::facade
