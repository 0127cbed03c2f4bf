#pragma once

#include <cstddef>
#include <functional>
#include <string>

namespace ringfence::tools {

/// Resources that a child process may use. The kernel ends a child that exceeds them.
struct ChildLimits {
  unsigned cpu_seconds = 20;
  std::size_t memory_bytes = std::size_t{4} << 30;  ///< in addition to those of this process; no limit under sanitizers
};

/// Result of run_in_child.
struct ChildResult {
  std::string output;  ///< what `work` returned
  std::string error;   ///< empty if `work` returned, else how the child ended, for example "crashed (signal 11)"
};

/// Runs `work` in a forked copy of this process and returns its result. It isolates library code that may crash, hang
/// or exhaust memory on untrusted input. Other effects of `work` on memory do not reach this process.
///
/// The copy has only the calling thread, so `work` must not wait for other threads or lock a mutex that they may hold.
/// Cost: about 1 ms. Throws Error if the system cannot create a process.
ChildResult run_in_child(const std::function<std::string()>& work, const ChildLimits& limits);

}  // namespace ringfence::tools
