#pragma once

namespace ringfence::base {

// Both functions are inline assembly on x86-64. g++ 12 removes calls of a function that only contains
// __builtin_prefetch, because it takes such a function for one without effect; and for plain x86-64 code
// __builtin_prefetch(p, 1) emits the instruction for reading.

/// Loads the cache line at `address` into the cache, for a read that follows soon. Any address is allowed.
inline void prefetch_for_read(const void* address) noexcept {
#if defined(__x86_64__)
  asm volatile("prefetcht0 %0" : : "m"(*static_cast<const char*>(address)));
#else
  __builtin_prefetch(address);
#endif
}

/// The same for a write that follows soon: the line is loaded in exclusive state, so that the store need not wait until
/// other cores have given it up. Every x86-64 processor accepts the instruction; some ignore it. For memory that only
/// this core uses, prefetch_for_read() costs less.
inline void prefetch_for_write(const void* address) noexcept {
#if defined(__x86_64__)
  asm volatile("prefetchw %0" : : "m"(*static_cast<const char*>(address)));
#else
  __builtin_prefetch(address, 1);
#endif
}

/// Evicts the cache line at `address` from all caches, before another core overwrites it without reading it. Only on
/// processors with CLFLUSHOPT.
inline void evict_line(const void* address) noexcept {
#if defined(__x86_64__)
  asm volatile("clflushopt %0" : : "m"(*static_cast<const char*>(address)));
#else
  static_cast<void>(address);
#endif
}

/// Loads all lines of `object` for a read that follows soon. Unless its type is aligned to lines, the object may start
/// anywhere in a line.
template <class T>
inline void prefetch_object(const T& object) noexcept {
  const char* const first = reinterpret_cast<const char*>(&object);
  for (unsigned at = 0; at < sizeof(T); at += 64) {
    prefetch_for_read(first + at);
  }
  if constexpr (alignof(T) < 64) prefetch_for_read(first + sizeof(T) - 1);
}

}  // namespace ringfence::base
