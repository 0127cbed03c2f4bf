#include "machine.hpp"

#include <algorithm>
#include <fstream>
#include <thread>

#include <sys/utsname.h>

namespace ringfence::tools {
namespace {

std::string cpu_model() {
  std::ifstream file("/proc/cpuinfo");
  for (std::string line; std::getline(file, line);) {
    if (!line.starts_with("model name")) continue;
    const std::size_t colon = line.find(':');
    if (colon != std::string::npos && colon + 2 <= line.size()) return line.substr(colon + 2);
  }
  return {};
}

}  // namespace

Machine this_machine() {
  Machine machine;
  machine.cpu = cpu_model();
  machine.cores = std::max(1u, std::thread::hardware_concurrency());
  utsname system{};
  if (uname(&system) == 0) {
    machine.system = std::string(system.sysname) + " " + system.release + " " + system.machine;
    if (machine.cpu.empty()) machine.cpu = system.machine;
  }
#if defined(__clang__)
  machine.compiler = "clang++ " __clang_version__;
#else
  machine.compiler = "g++ " __VERSION__;
#endif
#ifdef NDEBUG
  machine.build = "release";
#else
  machine.build = "debug";
#endif
  return machine;
}

}  // namespace ringfence::tools
