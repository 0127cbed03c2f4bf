#pragma once

namespace ringfence::tools {

/// From now on the C library returns the memory of arrays of at least 128 KiB to the system when they are freed. By
/// default it keeps arrays of that size in the heap once a larger one was freed, and what start-up has used stays
/// resident. No effect without glibc.
void return_freed_arrays() noexcept;

/// From now on it keeps the memory of freed arrays below 32 MiB, as it may by default: frames that allocate such arrays
/// again need no system calls and no new pages.
void keep_freed_arrays() noexcept;

}  // namespace ringfence::tools
