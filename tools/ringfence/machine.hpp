#pragma once

#include <string>

namespace ringfence::tools {

/// The machine and build that a report's figures were measured with.
struct Machine {
  std::string cpu;            ///< model name, or the architecture if that is unknown
  unsigned cores = 1;         ///< of the machine
  unsigned usable_cores = 1;  ///< of those, the cores that the CPU affinity of this process allows
  std::string system;         ///< e.g. "Linux 6.1.0 x86_64"
  std::string compiler;       ///< e.g. "g++ 12.2.0"
  std::string build;          ///< "release", or "debug" if assertions are on
};

Machine this_machine();

/// Number of cores that the CPU affinity of the calling thread allows (`taskset`, container CPU sets); at least 1.
unsigned usable_cores();

}  // namespace ringfence::tools
