#pragma once

#include <cstdint>
#include <memory>
#include <mutex>
#include <span>
#include <utility>
#include <vector>

#include "queries/frame_object.hpp"

namespace ringfence::queries {

/// An order of objects in which neighbours in space are near each other: that of a BoxTree. It is found once for some
/// frames, because objects move little from one frame to the next, and to sort takes twice the time of an index.
struct TreeOrder {
  std::vector<std::uint32_t> rows;  ///< those that have an object
  double cost = 0;                  ///< BoxTree::cost() of the tree when the objects were sorted
  std::uint32_t end = 0;            ///< more than the last of the rows
};

/// Sets `out` to the order of `before` for other objects: without the rows that have none now, and with those that have
/// one since at the end. `count`: number of rows with an object. False if so many are new that sorting is better. `out`
/// is another object. Allocates only if `out` or the thread has had less. May throw std::bad_alloc.
bool adapt(const TreeOrder& before, std::span<const FrameObject> objects, std::size_t count, TreeOrder& out);
/// Whether exactly the rows of the order have objects.
bool has_same_rows(const TreeOrder& order, std::span<const FrameObject> objects, std::size_t count) noexcept;

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
