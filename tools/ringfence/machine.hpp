#pragma once

#include <string>

namespace ringfence::tools {

/// What a figure was measured on.
struct Machine {
  std::string cpu;  ///< the model's name, or the architecture
  unsigned cores = 1;
  std::string system;    ///< e.g. "Linux 6.1.0 x86_64"
  std::string compiler;  ///< e.g. "g++ 12.2.0"
  std::string build;     ///< "release" or "debug" (assertions on)
};

Machine this_machine();

}  // namespace ringfence::tools
