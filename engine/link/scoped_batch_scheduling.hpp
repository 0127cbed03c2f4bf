#pragma once

#include <sched.h>

namespace ringfence::link {

/// Runs the calling thread under the scheduling policy SCHED_BATCH for the lifetime of this object. Threads that it
/// creates meanwhile inherit the policy and keep it.
///
/// A SCHED_BATCH thread that wakes up does not preempt the running thread; it still gets an idle core at once. With
/// more threads than cores, each stage of a frame causes a burst of wake-ups. Under the default policy each thread that
/// wakes up preempts a thread that has just begun to reply, or the server before it has sent all its messages. Measured
/// on two cores, default policy and SCHED_BATCH: with 4 processes 237 and 208 us a stage; with the 18 threads of a
/// World of 16 CD nodes 16.2 and 14.5 ms a frame.
///
/// The cost: such threads give way to all other processes. While a compiler runs on the same machine, the same frame
/// takes several times as long, so a World does not enable this by itself.
///
/// Does nothing if the thread does not have the default policy, or if the system refuses. Threads: construct and
/// destroy it on the same thread. Linux only.
class ScopedBatchScheduling {
 public:
  ScopedBatchScheduling() noexcept : changed_(sched_getscheduler(0) == SCHED_OTHER && set(SCHED_BATCH)) {}
  ~ScopedBatchScheduling() {
    if (changed_) {
      set(SCHED_OTHER);
    }
  }
  ScopedBatchScheduling(const ScopedBatchScheduling&) = delete;
  ScopedBatchScheduling& operator=(const ScopedBatchScheduling&) = delete;

 private:
  static bool set(int policy) noexcept {
    const sched_param parameters{};
    return sched_setscheduler(0, policy, &parameters) == 0;
  }

  bool changed_;
};

}  // namespace ringfence::link
