#pragma once

#include <atomic>
#include <thread>

#include <sys/mman.h>
#include <sys/wait.h>
#include <unistd.h>

#include "ringfence/error.hpp"
#include "telemetry/clock.hpp"

namespace ringfence::bench {

/// Wall time of `work`.
template <class Work>
double seconds_of(const Work& work) {
  const std::uint64_t start = telemetry::now_ns();
  work();
  return static_cast<double>(telemetry::now_ns() - start) * 1e-9;
}

/// Wall time of `work` in two child processes that begin together. The children only compute: no other thread of this
/// process runs while they are created.
template <class Work>
double seconds_of_two_processes(const Work& work) {
  struct Shared {
    std::atomic<int> ready{0};
    std::atomic<bool> go{false};
  };
  void* memory = mmap(nullptr, sizeof(Shared), PROT_READ | PROT_WRITE, MAP_SHARED | MAP_ANONYMOUS, -1, 0);
  if (memory == MAP_FAILED) throw Error("no shared memory");
  auto* shared = new (memory) Shared;
  pid_t children[2];
  for (pid_t& child : children) {
    child = fork();
    if (child != 0) continue;
    shared->ready.fetch_add(1);
    while (!shared->go.load()) std::this_thread::yield();
    work();
    _exit(0);
  }
  while (shared->ready.load() < 2) std::this_thread::yield();
  const double seconds = seconds_of([&] {
    shared->go.store(true);
    for (const pid_t child : children) waitpid(child, nullptr, 0);
  });
  munmap(memory, sizeof(Shared));
  return seconds;
}

}  // namespace ringfence::bench
