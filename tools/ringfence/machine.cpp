#include "machine.hpp"

#include <algorithm>
#include <cerrno>
#include <cstddef>
#include <fstream>
#include <thread>
#include <vector>

#include <sched.h>
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

unsigned usable_cores() {
  // The set must have room for all CPUs that the kernel supports; their number is not known.
  for (std::size_t bits = 1024; bits <= std::size_t{1} << 20; bits *= 2) {
    std::vector<unsigned long> set(bits / (8 * sizeof(unsigned long)));
    const std::size_t bytes = set.size() * sizeof(unsigned long);
    auto* const cpus = reinterpret_cast<cpu_set_t*>(set.data());
    if (sched_getaffinity(0, bytes, cpus) == 0) return std::max(1, CPU_COUNT_S(bytes, cpus));
    if (errno != EINVAL) break;
  }
  return std::max(1u, std::thread::hardware_concurrency());
}

Machine this_machine() {
  Machine machine;
  machine.cpu = cpu_model();
  machine.cores = std::max(1u, std::thread::hardware_concurrency());
  machine.usable_cores = usable_cores();
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
