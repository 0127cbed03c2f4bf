#pragma once

#include <atomic>
#include <cstddef>
#include <cstdint>

#include <oneapi/tbb/blocked_range.h>
#include <oneapi/tbb/parallel_for.h>
#include <oneapi/tbb/parallel_invoke.h>
#include <oneapi/tbb/task_group.h>

/// Loops and calls that run in parallel, by oneTBB. The engine uses them to prepare shapes and to check results, never
/// in a frame.
///
/// The tasks run in the floating-point environment that the caller has now. By default they would run in the one that
/// the thread had when it first used oneTBB, which may be the embedder's.
namespace ringfence::base {

namespace detail {

inline oneapi::tbb::task_group_context task_context() {
  using Context = oneapi::tbb::task_group_context;
  return Context(Context::bound, Context::default_traits | Context::fp_settings);
}

/// What the caller wrote happens before the tasks, and they happen before the caller continues. oneTBB guarantees the
/// same, but its library is not instrumented: without this object the thread sanitizer takes every access of a task for
/// a race.
class TaskOrder {
 public:
  TaskOrder() { state_.store(1, std::memory_order_release); }
  template <class Work>
  void run(const Work& work) {
    state_.load(std::memory_order_acquire);
    work();
    state_.fetch_add(1, std::memory_order_release);
  }
  void finish() { state_.load(std::memory_order_acquire); }

 private:
  std::atomic<std::uint32_t> state_{0};
};

}  // namespace detail

/// Calls body(i) for each i < count, in any order. A task has at least `grain` consecutive numbers, or all.
template <class Body>
void parallel_for(std::size_t count, std::size_t grain, const Body& body) {
  detail::TaskOrder order;
  auto context = detail::task_context();
  const auto task = [&](const oneapi::tbb::blocked_range<std::size_t>& range) {
    order.run([&] {
      for (std::size_t i = range.begin(); i != range.end(); ++i) {
        body(i);
      }
    });
  };
  oneapi::tbb::parallel_for(oneapi::tbb::blocked_range<std::size_t>(0, count, grain), task, context);
  order.finish();
}

/// Calls first() and second(), in any order.
template <class First, class Second>
void parallel_invoke(const First& first, const Second& second) {
  detail::TaskOrder order;
  auto context = detail::task_context();
  oneapi::tbb::parallel_invoke([&] { order.run(first); }, [&] { order.run(second); }, context);
  order.finish();
}

}  // namespace ringfence::base
