#pragma once

#include <cstddef>
#include <functional>
#include <string>

namespace ringfence::tools {

/// What a child process may use before it is ended.
struct ChildLimits {
  unsigned cpu_seconds = 20;
  std::size_t memory_bytes = std::size_t{4} << 30;  ///< beyond what this process has; not kept under the sanitizers
};

/// What came of a child process.
struct ChildResult {
  std::string output;  ///< what `work` returned
  std::string end;     ///< empty, or how the child ended instead of returning: "crashed (signal 11)"
};

/// Runs `work` in a copy of this process and returns what it returned: for code of others that may crash, hang or take
/// all memory on bytes that nobody vouches for. What it does otherwise is lost with the copy.
///
/// The copy has this thread alone, so `work` waits for no other, and locks nothing but what libc does. Costs about a
/// millisecond. Throws Error where the system makes no process.
ChildResult run_in_child(const std::function<std::string()>& work, const ChildLimits& limits);

}  // namespace ringfence::tools
