#pragma once

#include <cstddef>
#include <new>
#include <vector>

namespace ringfence::base {

/// Allocates at multiples of 64 bytes, the size of a cache line. So a vector load of up to 64 bytes, at a multiple of
/// its own size from the start, lies within one line. Throws std::bad_alloc. Precondition: alignof(T) is at most 64.
template <class T>
struct CacheLineAllocator {
  using value_type = T;
  static constexpr std::align_val_t alignment{64};

  CacheLineAllocator() noexcept = default;
  template <class U>
  CacheLineAllocator(const CacheLineAllocator<U>&) noexcept {}

  T* allocate(std::size_t count) { return static_cast<T*>(::operator new(count * sizeof(T), alignment)); }
  void deallocate(T* first, std::size_t) noexcept { ::operator delete(first, alignment); }
  bool operator==(const CacheLineAllocator&) const noexcept = default;
};

/// A std::vector whose first element starts on a cache line.
template <class T>
using AlignedVector = std::vector<T, CacheLineAllocator<T>>;

}  // namespace ringfence::base
