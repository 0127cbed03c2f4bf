#pragma once

namespace ringfence::bench {

/// Registers memory/mixed/<n>/<impl>: what an implementation of a frame keeps in memory for an object.
///
/// Call it before other benchmarks are registered: they run in this order, and these fork, which is only safe while
/// this process has one thread. That is why implementations with threads are left out.
void add_memory_benchmarks();

}  // namespace ringfence::bench
