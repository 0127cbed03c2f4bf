#pragma once

#include <atomic>
#include <mutex>

namespace ringfence::queries {

/// An index that the first reader builds.
///
/// Threads: get() by any number of threads, which wait for each other only while one of them builds; discard() while
/// no other thread uses it. Memory: that of the index, kept.
template <class Index>
class LazyIndex {
 public:
  /// The next get() builds the index again.
  void discard() noexcept { built_.store(false, std::memory_order_relaxed); }
  /// The index; `build(index)` makes it, unless an earlier call has. What `build` throws is passed on, and the next
  /// call tries again.
  template <class Build>
  const Index& get(const Build& build) const {
    // Pairs with the release store below: the whole index is visible with it.
    if (!built_.load(std::memory_order_acquire)) {
      const std::lock_guard lock(building_);
      if (!built_.load(std::memory_order_relaxed)) {
        build(index_);
        built_.store(true, std::memory_order_release);
      }
    }
    return index_;
  }

 private:
  mutable Index index_;
  mutable std::mutex building_;
  mutable std::atomic<bool> built_{false};
};

}  // namespace ringfence::queries
