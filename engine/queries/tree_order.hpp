#pragma once

#include <cstdint>
#include <memory>
#include <mutex>
#include <span>
#include <utility>
#include <vector>

#include "base/pair_sort.hpp"
#include "geometry/bounds.hpp"
#include "queries/frame_object.hpp"

namespace ringfence::queries {

/// An order of objects in which neighbours in space are near each other: that of a BoxTree. It is found once for some
/// frames, because objects move little from one frame to the next, and to sort takes a third of the time of an index.
struct TreeOrder {
  std::vector<std::uint32_t> rows;  ///< those that have an object
  double cost = 0;                  ///< BoxTree::cost() of the tree when the objects were sorted
};

/// Sorts rows by position along a Hilbert curve through `space`.
///
/// Threads: belongs to one. Memory: grows to the largest call. May throw std::bad_alloc.
class CurveSort {
 public:
  void sort(std::span<const FrameObject> objects, const geometry::FixedSpace& space, std::vector<std::uint32_t>& rows);

 private:
  base::PairSort sort_;
  std::vector<std::uint32_t> sorted_;
};

/// The order of `before` for other objects: without the rows that have none now, and with those that have one since at
/// the end. `count`: number of rows with an object. Null if `before` is, or if so many are new that sorting is better.
/// May throw std::bad_alloc.
std::shared_ptr<const TreeOrder> adapt(std::shared_ptr<const TreeOrder> before, std::span<const FrameObject> objects,
                                       std::size_t count);

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
