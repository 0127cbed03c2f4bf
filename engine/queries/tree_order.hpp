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
/// frames, because objects move little from one frame to the next, and to sort takes a third of the time of an index.
struct TreeOrder {
  std::vector<std::uint32_t> rows;  ///< those that have an object
  double cost = 0;                  ///< BoxTree::cost() of the tree when the objects were sorted
  std::uint32_t end = 0;            ///< more than the last of the rows
};

/// Finds an order of rows by halving: the objects are divided at the median along the longest side of the box around
/// their positions, and each half again, down to the leaves of the tree, so that each node of the tree has the objects
/// of a box. (A k-d tree; Bentley 1975.)
///
/// Threads: belongs to one. Memory: grows to the largest call. May throw std::bad_alloc.
class MedianSplits {
 public:
  void sort(std::span<const FrameObject> objects, std::vector<std::uint32_t>& rows);

 private:
  struct Point {
    float at[3];  ///< metres from the first object
    std::uint32_t row;
  };
  void split(std::span<Point> points, std::size_t each);
  void put_first(std::span<Point> points, std::size_t count, std::size_t axis, float lower, float upper);

  std::vector<Point> points_, moved_;
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
