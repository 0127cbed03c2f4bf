#pragma once

#include <algorithm>
#include <atomic>
#include <cstddef>
#include <memory>
#include <span>
#include <type_traits>
#include <utility>
#include <vector>

namespace ringfence::geometry {

/// An array of plain values to which one thread appends while others read the earlier values.
///
/// When a block is full, its values are copied to a block of twice the size. The old block is kept as long as the
/// array, because a reader may still use it; all old blocks together are smaller than the current one. So a reference
/// to a value is valid as long as the array, and reading is as fast as with a vector.
///
/// Threads: push_back by one thread at a time; replace by that thread, while no other reads; all other functions from
/// any thread.
template <class T>
class GrowingArray {
 public:
  static_assert(std::is_trivially_copyable_v<T>);

  std::size_t size() const noexcept { return size_.load(std::memory_order_acquire); }
  bool empty() const noexcept { return size() == 0; }
  const T* data() const noexcept { return values_.load(std::memory_order_acquire); }
  const T& operator[](std::size_t i) const noexcept { return data()[i]; }
  std::span<const T> span() const noexcept {
    const std::size_t size = this->size();  // read before the block, which then has at least as many values
    return {data(), size};
  }

  void push_back(const T& value) {
    const std::size_t size = size_.load(std::memory_order_relaxed);
    if (size == capacity_) {
      const std::size_t capacity = std::max<std::size_t>(16, 2 * capacity_);
      auto block = std::make_unique<T[]>(capacity);
      std::copy_n(data(), size, block.get());
      blocks_.push_back(std::move(block));
      capacity_ = capacity;
      // Pairs with the load in data: the copies are visible with the block.
      values_.store(blocks_.back().get(), std::memory_order_release);
    }
    blocks_.back()[size] = value;
    // Pairs with the load in size.
    size_.store(size + 1, std::memory_order_release);
  }

  /// Precondition: i < size().
  void replace(std::size_t i, const T& value) noexcept { blocks_.back()[i] = value; }

 private:
  std::vector<std::unique_ptr<T[]>> blocks_;  ///< the last is the current one
  std::size_t capacity_ = 0;
  std::atomic<const T*> values_{nullptr};
  std::atomic<std::size_t> size_{0};
};

}  // namespace ringfence::geometry
