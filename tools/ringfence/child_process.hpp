#pragma once

#include <cstddef>
#include <filesystem>
#include <string>
#include <string_view>
#include <vector>

namespace ringfence::tools {

/// Resources that a child process may use. The kernel ends a child that exceeds the first two, run_child one that
/// exceeds the others.
struct ChildLimits {
  unsigned cpu_seconds = 20;
  std::size_t memory_bytes = std::size_t{4}
                             << 30;  ///< beyond those of its program and input; no limit under sanitizers
  unsigned wall_seconds = 200;       ///< longer than cpu_seconds, as the machine may have other work
  std::size_t answer_bytes = std::size_t{256} << 20;  ///< length of the answer, which is in the memory of this process
};

/// Result of run_child.
struct ChildResult {
  std::string output;  ///< what the child answered
  std::string error;   ///< empty if it answered, else how it ended, for example "crashed (signal 11)"
};

/// A program of this installation, in ../libexec/ringfence beside the folder of the running program. `ringfence` starts
/// it, or loads it if it is a shared object: what it links is not in memory in other runs. Throws Error if the system
/// does not say where the running program is: a relative path could name a program of somebody else.
std::filesystem::path helper_program(const std::string& name);

/// Runs another program, which answers with answer_parent, and returns its answer. It isolates library code that may
/// crash, hang or exhaust memory on untrusted input: that process has neither the memory nor the files of this one.
///
/// Its arguments are `arguments`, and after them the limits. Its standard input is `input`, what it prints is
/// discarded. It has no variables of the environment but the path of its libraries and options of sanitizers. When
/// run_child returns or throws, it has ended. Cost: about 5 ms. Throws Error if the program cannot be started.
ChildResult run_child(const std::filesystem::path& program, std::vector<std::string> arguments, std::string_view input,
                      const ChildLimits& limits);

}  // namespace ringfence::tools
