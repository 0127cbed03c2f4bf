#include "facade/threads/worker.hpp"

#include <ctime>
#include <system_error>
#include <utility>

#include <pthread.h>

#include "base/floating_point.hpp"
#include "telemetry/clock.hpp"

namespace ringfence::facade {

Worker::~Worker() {
  dismiss();
  join();
  delete next_.load(std::memory_order_acquire);
}

void Worker::dismiss() noexcept {
  stop_.store(true, std::memory_order_release);
  bell_.ring();
}

void Worker::join() noexcept {
  if (thread_.joinable()) {
    thread_.join();
  }
}

bool Worker::start(Halt& halt, const link::Cores* cores, std::size_t pin_to, std::chrono::nanoseconds tick) {
  halt_ = &halt;
  try {
    thread_ = std::thread([this, cores, pin_to, tick] {
      // The thread has inherited the floating-point environment of the thread that called World.
      const base::DefaultFloatingPoint floating_point;
      if (cores != nullptr && pin_to != unpinned) {
        cores->pin_this_thread(pin_to);
      }
      run(tick);
      // Pairs with the acquire load in has_ended: the effects of the roles are visible.
      ended_.store(true, std::memory_order_release);
    });
  } catch (const std::system_error&) {
    return false;
  }
  return true;
}

void Worker::assign(std::vector<Steppable> roles) {
  hand(std::unique_ptr<Assignment>(new Assignment{std::move(roles), std::nullopt}));
}

void Worker::assign(std::vector<Steppable> roles, TreeMember member) {
  hand(std::unique_ptr<Assignment>(new Assignment{std::move(roles), std::move(member)}));
}

// A thread without roles is not waited for. So many threads can take their first roles at the same time.
void Worker::hand(std::unique_ptr<Assignment> assignment) {
  const auto is_taken = [this] { return next_.load(std::memory_order_acquire) == nullptr; };
  taken_bell_.wait(is_taken);
  const bool waits = std::exchange(steps_roles_, !assignment->roles.empty());
  // Pairs with the acquire load in take_assignment: the list of roles is complete.
  next_.store(assignment.release(), std::memory_order_release);
  bell_.ring();
  if (waits) {
    taken_bell_.wait(is_taken);
  }
}

// Clears the pointer only after it has replaced the old roles: the facade may destroy them as soon as it reads null.
bool Worker::take_assignment() {
  Assignment* assignment = next_.load(std::memory_order_acquire);
  if (assignment == nullptr) {
    return false;
  }
  roles_ = std::move(assignment->roles);
  if (assignment->member) {
    member_ = std::move(*assignment->member);
    passed_wave_ = 0;
  }
  delete assignment;
  // Pairs with the acquire load in assign: the effects of the old roles are visible.
  next_.store(nullptr, std::memory_order_release);
  taken_bell_.ring();
  return true;
}

bool Worker::step_all() {
  bool progressed = take_assignment();
  if (member_.tree != nullptr) {
    member_.tree->pass_on(member_.index, passed_wave_);
  }
  for (const Steppable& role : roles_) {
    if (halt_->is_set()) {
      break;
    }
    const nodes::Step step = role.step(role.role);
    if (step == nodes::Step::abandoned) [[unlikely]] {
      // Another thread already steps the remaining roles.
      stop_.store(true, std::memory_order_relaxed);
      return true;
    }
    if (step == nodes::Step::out_of_memory) [[unlikely]] {
      halt_->set();
    }
    progressed |= step == nodes::Step::progressed;
  }
  return progressed;
}

void Worker::run(std::chrono::nanoseconds tick) {
  const auto ready = [this] { return stop_.load(std::memory_order_acquire) || step_all(); };
  while (!stop_.load(std::memory_order_acquire)) {
    if (tick.count() == 0) {
      bell_.wait(ready);
    } else {
      bell_.wait_for(ready, tick);
    }
    polled_cpu_ns_.store(telemetry::polled_cpu_ns, std::memory_order_relaxed);
  }
}

std::uint64_t Worker::working_cpu_ns() noexcept {
  const std::uint64_t polled_ns = polled_cpu_ns_.load(std::memory_order_relaxed);
  clockid_t clock;
  timespec used{};
  if (!thread_.joinable() || pthread_getcpuclockid(thread_.native_handle(), &clock) != 0 ||
      clock_gettime(clock, &used) != 0) {
    return 0;
  }
  return static_cast<std::uint64_t>(used.tv_sec) * 1'000'000'000u + static_cast<std::uint64_t>(used.tv_nsec) -
         polled_ns;
}

}  // namespace ringfence::facade
