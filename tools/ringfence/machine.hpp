#pragma once

#include <string>

namespace ringfence::tools {

/// The machine and build that a report's figures were measured with.
struct Machine {
  std::string cpu;  ///< model name, or the architecture if that is unknown
  unsigned cores = 1;
  std::string system;    ///< e.g. "Linux 6.1.0 x86_64"
  std::string compiler;  ///< e.g. "g++ 12.2.0"
  std::string build;     ///< "release", or "debug" if assertions are on
};

Machine this_machine();

}  // namespace ringfence::tools
