#include "heap_limits.hpp"

#include <cstdlib>  // defines __GLIBC__

#ifdef __GLIBC__
#include <malloc.h>
#endif

namespace ringfence::tools {
namespace {

// If one of them is set, glibc no longer adjusts either.
void set_limits([[maybe_unused]] int array_bytes, [[maybe_unused]] int free_bytes) noexcept {
#ifdef __GLIBC__
  (void)mallopt(M_MMAP_THRESHOLD, array_bytes);
  (void)mallopt(M_TRIM_THRESHOLD, free_bytes);
#endif
}

}  // namespace

void return_freed_arrays() noexcept { set_limits(128 << 10, 128 << 10); }

// The largest values that glibc adjusts them to.
void keep_freed_arrays() noexcept { set_limits(32 << 20, 64 << 20); }

}  // namespace ringfence::tools
