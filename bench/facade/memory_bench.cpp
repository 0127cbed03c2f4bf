#include "facade/memory_bench.hpp"

#include <algorithm>
#include <fstream>
#include <new>
#include <string>

#include <benchmark/benchmark.h>
#include <malloc.h>
#include <sys/mman.h>
#include <sys/wait.h>
#include <unistd.h>

#include "facade/frame_implementations.hpp"

namespace ringfence::bench {
namespace {

constexpr std::size_t recorded_frames = 8, played_frames = 24;

/// Written by the child.
struct Measured {
  std::size_t bytes = 0, contacts = 0;
};

/// Memory of this process that is resident and has no file: without the pages of programs and libraries, whose number
/// does not depend on the objects.
std::size_t resident_bytes() {
  std::ifstream lines("/proc/self/status");
  std::size_t sum = 0;
  for (std::string line; std::getline(lines, line);) {
    if (line.starts_with("RssAnon:") || line.starts_with("RssShmem:")) sum += std::stoul(line.substr(9)) * 1024;
  }
  return sum;
}

/// The largest growth of the resident memory, from before `make` creates the first object, after each of some frames.
Measured measure(const RecordedWorld& world, const Implementation& implementation) {
  const std::size_t before = resident_bytes();
  const std::unique_ptr<FrameTester> tester = implementation.make(world);
  Measured result;
  for (std::size_t k = 0; k < played_frames; ++k) {
    tester->run(world.frames[world.played(k)]);
    result.bytes = std::max(result.bytes, resident_bytes() - before);
  }
  result.contacts = tester->contacts();
  return result;
}

/// Runs `measure` in a child process, so that no implementation uses memory that another one has freed. All zeros if
/// the child failed.
Measured measure_in_child(const RecordedWorld& world, const Implementation& implementation) {
  void* memory = mmap(nullptr, sizeof(Measured), PROT_READ | PROT_WRITE, MAP_SHARED | MAP_ANONYMOUS, -1, 0);
  if (memory == MAP_FAILED) throw Error("no shared memory");
  auto* shared = new (memory) Measured;
  // The child would otherwise use, without growth, pages that the recording has freed.
  malloc_trim(0);
  const pid_t child = fork();
  if (child == 0) {
    *shared = measure(world, implementation);
    _exit(0);
  }
  int status = -1;
  waitpid(child, &status, 0);
  const Measured result = status == 0 ? *shared : Measured();
  munmap(memory, sizeof(Measured));
  return result;
}

// The implementations run one after the other and share a world, so only the last world is kept.
const RecordedWorld& world_of(std::uint32_t objects) {
  static RecordedWorld world;
  if (world.objects() != objects) world = record_world(worlds::ShapeSetting::mixed, objects, recorded_frames);
  return world;
}

void run(benchmark::State& state, std::uint32_t objects, const Implementation& implementation) {
  const RecordedWorld& world = world_of(objects);
  Measured result;
  for (auto _ : state) result = measure_in_child(world, implementation);
  if (result.bytes == 0) {
    state.SkipWithError("the child process failed");
    return;
  }
  state.counters["bytes_per_object"] = static_cast<double>(result.bytes) / static_cast<double>(objects);
  state.counters["contacts"] = static_cast<double>(result.contacts);
}

}  // namespace

void add_memory_benchmarks() {
  for (const std::uint32_t objects : {64000u, 256000u}) {
    for (const Implementation& implementation : frame_implementations()) {
      if (implementation.threads || objects > implementation.max_objects) continue;
      const std::string name = "memory/mixed/" + std::to_string(objects) + '/' + implementation.name;
      benchmark::RegisterBenchmark(name.c_str(), [=](benchmark::State& state) { run(state, objects, implementation); })
          ->Unit(benchmark::kMillisecond)
          ->Iterations(1);
    }
  }
}

}  // namespace ringfence::bench
