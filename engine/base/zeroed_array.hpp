#pragma once

#include <cstddef>
#include <cstdlib>
#include <new>
#include <type_traits>
#include <utility>

#include "base/system_memory.hpp"

namespace ringfence::base {

/// An array of a fixed number of elements, all of whose bytes are 0 at first.
///
/// The memory of a large array comes from the system (allocate_from_system). So the parts of a table that are never
/// written, such as a hash table that is reserved for the worst case, occupy addresses but no memory.
///
/// The constructor throws std::bad_alloc.
template <class T>
class ZeroedArray {
  static_assert(std::is_trivially_copyable_v<T> && std::is_trivially_destructible_v<T>);
  static_assert(alignof(T) <= alignof(std::max_align_t));

 public:
  ZeroedArray() = default;
  explicit ZeroedArray(std::size_t size)
      : first_(static_cast<T*>(is_large(size) ? allocate_from_system(size * sizeof(T)) : std::calloc(size, sizeof(T)))),
        size_(size) {
    if (first_ == nullptr && size != 0) {
      throw std::bad_alloc();
    }
  }
  ZeroedArray(ZeroedArray&& other) noexcept
      : first_(std::exchange(other.first_, nullptr)), size_(std::exchange(other.size_, 0)) {}
  ZeroedArray& operator=(ZeroedArray&& other) noexcept {
    std::swap(first_, other.first_);
    std::swap(size_, other.size_);
    return *this;
  }
  ~ZeroedArray() { is_large(size_) ? free_to_system(first_, size_ * sizeof(T)) : std::free(first_); }

  std::size_t size() const noexcept { return size_; }
  T& operator[](std::size_t i) noexcept { return first_[i]; }
  const T& operator[](std::size_t i) const noexcept { return first_[i]; }
  const T* begin() const noexcept { return first_; }
  const T* end() const noexcept { return first_ + size_; }

 private:
  static constexpr bool is_large(std::size_t size) noexcept { return size * sizeof(T) >= least_system_bytes; }

  T* first_ = nullptr;
  std::size_t size_ = 0;
};

}  // namespace ringfence::base
