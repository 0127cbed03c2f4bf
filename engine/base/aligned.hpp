#pragma once

#include <cstddef>
#include <new>
#include <vector>

namespace ringfence::base {

/// Allocates on cache-line boundaries, so an aligned vector load of any width never crosses two lines.
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

/// A vector whose elements start on a cache line.
template <class T>
using AlignedVector = std::vector<T, CacheLineAllocator<T>>;

}  // namespace ringfence::base
