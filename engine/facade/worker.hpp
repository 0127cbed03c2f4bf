#pragma once

#include <atomic>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <thread>
#include <vector>

#include "facade/steppable.hpp"
#include "link/cores.hpp"
#include "link/doorbell.hpp"

namespace ringfence::facade {

/// Set when a role of the World has run out of memory. From then on no thread steps any role, and no frame completes.
///
/// Threads: any. Each World has one, which outlives its threads.
class Halt {
 public:
  /// `caller` is rung when it is set; null if the calling thread steps all roles itself.
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
/// Threads: assign() and the destructor are called by the facade's thread. Lock-free: a new list of roles is passed
/// through one atomic pointer.
class Worker {
 public:
  /// `pin_to`: index into `cores`, or `unpinned`.
  static constexpr std::size_t unpinned = ~std::size_t{0};

  Worker() = default;
  /// Stops and joins the thread; the roles' channels must still exist.
  ~Worker();
  Worker(const Worker&) = delete;
  Worker& operator=(const Worker&) = delete;

  link::Doorbell& bell() noexcept { return bell_; }
  /// Returns false if the system has no thread. `halt` is set when a role runs out of memory, and no role is stepped
  /// once it is set; it outlives the thread. `tick`: longest time between two steps of the roles when no bell rings; 0:
  /// roles are stepped only when a bell rings.
  [[nodiscard]] bool start(Halt& halt, const link::Cores* cores, std::size_t pin_to,
                           std::chrono::nanoseconds tick = {});
  /// Replaces the roles of the thread; returns when the thread no longer accesses the old ones. Between frames.
  void assign(std::vector<Steppable> roles);
  /// Asks the thread to end without waiting for it; after has_ended() is true it steps no role any more. For threads
  /// that may be stuck.
  void dismiss() noexcept;
  /// Waits for the thread to end. Precondition: it has been dismissed, and everything that its roles use still exists.
  void join() noexcept;
  bool has_ended() const noexcept { return ended_.load(std::memory_order_acquire); }
  /// CPU time of the thread, nanoseconds; 0 before start.
  std::uint64_t cpu_ns() noexcept;

 private:
  struct Assignment {
    std::vector<Steppable> roles;
  };

  void run(std::chrono::nanoseconds tick);
  bool take_assignment();
  bool step_all();

  link::Doorbell bell_;
  link::Doorbell taken_bell_;  ///< rung when the thread has taken an assignment
  std::atomic<Assignment*> next_{nullptr};
  std::atomic<bool> stop_{false};
  std::atomic<bool> ended_{false};
  Halt* halt_ = nullptr;
  std::vector<Steppable> roles_;  ///< accessed by the thread only
  std::thread thread_;
};

}  // namespace ringfence::facade
