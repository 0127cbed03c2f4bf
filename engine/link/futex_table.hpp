#pragma once

#include <cstddef>

namespace ringfence::link {

/// Makes the kernel's table of sleeping threads large enough for so many threads of this process.
///
/// To wake a thread, Linux searches one slot of a hash table, among all threads that sleep there. Since Linux 6.16 each
/// process has a table of its own, with four slots a core and at least 16. With 1024 threads on two cores each ring
/// then looks at 64 threads, most of which are in no cache: a ring took about 20 us instead of 5. So the table gets
/// at least four slots a thread, unless it already has one for every two threads. It is never made smaller. Up to 32
/// threads nothing is changed.
///
/// A change takes the kernel about 30 ms if the process has other threads; they may sleep and be woken meanwhile. So
/// call it once for all threads, before they start. Earlier kernels have one table for all processes, with 256 slots a
/// core: there, and where the system refuses, this does nothing. Threads: any.
void reserve_futex_slots(std::size_t threads) noexcept;

}  // namespace ringfence::link
