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

/// One thread that steps the roles given to it and sleeps on its doorbell when none of them gets on.
///
/// Threads: assign() and the destructor from the facade's thread. No locks: a new list of roles is handed over by one
/// exchange.
class Worker {
 public:
  /// `pin_to`: index into `cores`, or none to leave the thread to the system.
  static constexpr std::size_t unpinned = ~std::size_t{0};

  Worker() = default;
  /// Stops and joins the thread; the roles' channels must still exist.
  ~Worker();
  Worker(const Worker&) = delete;
  Worker& operator=(const Worker&) = delete;

  link::Doorbell& bell() noexcept { return bell_; }
  /// `tick`: the roles are stepped at least so often, also when nothing rings; 0: only when something does.
  void start(const link::Cores* cores, std::size_t pin_to, std::chrono::nanoseconds tick = {});
  /// Replaces the roles that the thread steps and returns when the old ones are no longer touched. Between frames.
  void assign(std::vector<Steppable> roles);
  /// Asks the thread to end, without waiting for it; it steps no role any more once has_ended() answers true. For a
  /// thread of which nobody knows whether it still does anything.
  void dismiss() noexcept;
  bool has_ended() const noexcept { return ended_.load(std::memory_order_acquire); }
  /// CPU time that the thread has used, nanoseconds. 0 before start.
  std::uint64_t cpu_ns() noexcept;

 private:
  struct Assignment {
    std::vector<Steppable> roles;
  };

  void run(std::chrono::nanoseconds tick);
  bool take_assignment();
  bool step_all();

  link::Doorbell bell_;
  link::Doorbell taken_bell_;  ///< the facade waits here for an assignment to be taken
  std::atomic<Assignment*> next_{nullptr};
  std::atomic<bool> stop_{false};
  std::atomic<bool> ended_{false};
  std::vector<Steppable> roles_;  ///< the thread's own
  std::thread thread_;
};

}  // namespace ringfence::facade
