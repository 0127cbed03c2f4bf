#pragma once

#include <cstdint>
#include <memory>
#include <mutex>
#include <utility>
#include <vector>

#include "queries/frame_object.hpp"

namespace ringfence::queries {

/// An order of objects in which neighbours in space are near each other: that of a BoxTree. It is found once for some
/// frames, because objects move little from one frame to the next, and to sort takes twice the time of an index.
struct TreeOrder {
  std::vector<std::uint32_t> keys;  ///< of the objects
  double cost = 0;                  ///< BoxTree::cost() of the tree when the objects were sorted
};

/// Sets `out` to the order of `before` for other objects: without the keys that have none now, and with those that have
/// one since at the end. False if so many are new that sorting is better. `out` is another object. Allocates only if
/// `out` or the thread has had less. May throw std::bad_alloc.
bool adapt(const TreeOrder& before, const FrameRows& objects, TreeOrder& out);

/// The order that the last index of a world had. Any thread may call it.
class LastOrder {
 public:
  std::shared_ptr<const TreeOrder> get() const {
    const std::lock_guard lock(mutex_);
    return order_;
  }
  void set(std::shared_ptr<const TreeOrder> order) {
    const std::lock_guard lock(mutex_);
    order_ = std::move(order);
  }

 private:
  mutable std::mutex mutex_;
  std::shared_ptr<const TreeOrder> order_;
};

}  // namespace ringfence::queries
