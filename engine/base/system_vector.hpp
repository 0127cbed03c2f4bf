#pragma once

#include <cstddef>
#include <memory>
#include <vector>

#include "base/system_memory.hpp"

namespace ringfence::base {

/// Takes large arrays from the system (allocate_from_system), so that their memory does not stay in the heap when they
/// are freed. Throws std::bad_alloc.
template <class T>
struct SystemAllocator {
  using value_type = T;

  SystemAllocator() noexcept = default;
  template <class U>
  SystemAllocator(const SystemAllocator<U>&) noexcept {}

  T* allocate(std::size_t count) {
    return is_large(count) ? static_cast<T*>(allocate_from_system(count * sizeof(T)))
                           : std::allocator<T>().allocate(count);
  }
  void deallocate(T* first, std::size_t count) noexcept {
    is_large(count) ? free_to_system(first, count * sizeof(T)) : std::allocator<T>().deallocate(first, count);
  }
  bool operator==(const SystemAllocator&) const noexcept = default;

 private:
  static constexpr bool is_large(std::size_t count) noexcept { return count * sizeof(T) >= least_system_bytes; }
};

/// A std::vector for lists that are large only while a world is loaded.
template <class T>
using SystemVector = std::vector<T, SystemAllocator<T>>;

}  // namespace ringfence::base
