#pragma once

namespace ringfence::nodes {

// In assembly, because g++ 12 takes a function that does nothing but __builtin_prefetch for one without effect and
// leaves out its calls; and because plain x86-64 code has no built-in for the second.

/// Asks for the line of the cache at `at`, which will be read soon. Any address will do.
inline void fetch_to_read(const void* at) noexcept {
#if defined(__x86_64__)
  asm volatile("prefetcht0 %0" : : "m"(*static_cast<const char*>(at)));
#else
  __builtin_prefetch(at);
#endif
}

/// The same of one that will be written soon: as the writer's own, else the store would wait for it all the same, and
/// all stores behind it. Every processor accepts the instruction, and some ignore it.
inline void fetch_to_write(const void* at) noexcept {
#if defined(__x86_64__)
  asm volatile("prefetchw %0" : : "m"(*static_cast<const char*>(at)));
#else
  __builtin_prefetch(at, 1);
#endif
}

}  // namespace ringfence::nodes
