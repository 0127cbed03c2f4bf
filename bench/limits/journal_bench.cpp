#include "journal_bench.hpp"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <random>
#include <string>
#include <vector>

#include <benchmark/benchmark.h>
#include <time.h>
#include <unistd.h>

#include "motion/steering.hpp"
#include "ringfence/journal.hpp"

namespace ringfence::bench {
namespace {

constexpr std::uint32_t users = 1000;

double thread_cpu_ms() {
  timespec now{};
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &now);
  return static_cast<double>(now.tv_sec) * 1e3 + static_cast<double>(now.tv_nsec) * 1e-6;
}

double median(std::vector<double>& values) {
  std::nth_element(values.begin(), values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2), values.end());
  return values[values.size() / 2];
}

/// A world of the paper's kind, in which each of 1000 users has an avatar.
class Crowd {
 public:
  Crowd(std::uint32_t objects, std::shared_ptr<Recorder> recorder) : random_(1) {
    WorldConfig config;
    config.nodes = 0;
    motion::SteeringConfig steering;
    const double side = 4 * std::cbrt(objects);
    steering.bounds_max = config.bounds_max = {side, side, side};
    steering.targets = std::max(1u, objects / 50);
    config.motion = std::make_shared<motion::Steering>(steering);
    config.capacities.objects = objects;
    config.capacities.users = users;
    config.recorder = std::move(recorder);
    world_ = std::make_unique<World>(config);
    side_ = side;
    const ShapeId ball = world_->add_shape(Sphere{0.8f});
    for (std::uint32_t i = 0; i < objects; ++i) {
      ObjectSpec spec{.shape = ball, .pose = {place(), {}}};
      if (i < users) {
        spec.category = Category::avatar;
        spec.user = world_->connect().user;
      }
      const ObjectId id = world_->spawn(spec).id;
      if (i < users) avatars_.push_back({spec.user, id, spec.pose});
    }
  }

  /// CPU milliseconds of the frame alone, with what the journal does in it.
  double run_frame() {
    for (Avatar& avatar : avatars_) {
      Vec3d& p = avatar.pose.position;
      p = {p.x + step(), p.y + step(), p.z + step()};
      (void)world_->move(avatar.user, avatar.id, avatar.pose);
    }
    const double begin = thread_cpu_ms();
    (void)world_->advance();
    return thread_cpu_ms() - begin;
  }

 private:
  struct Avatar {
    UserId user;
    ObjectId id;
    Pose pose;
  };
  double uniform() { return static_cast<double>(random_() >> 11) * 0x1p-53; }
  double step() { return 0.2 * (uniform() - 0.5); }
  Vec3d place() { return {side_ * uniform(), side_ * uniform(), side_ * uniform()}; }

  std::mt19937_64 random_;
  double side_ = 0;
  std::unique_ptr<World> world_;
  std::vector<Avatar> avatars_;
};

void run(benchmark::State& state, std::uint32_t objects, JournalSync sync) {
  const std::filesystem::path directory =
      std::filesystem::temp_directory_path() / ("ringfence_journal_bench_" + std::to_string(getpid()));
  std::filesystem::remove_all(directory);
  JournalConfig config;
  config.directory = directory;
  config.sync = sync;
  config.snapshot_every = 1'000'000;
  std::vector<double> with, without;
  {
    Crowd recorded(objects, Journal::create(config)), plain(objects, nullptr);
    for (int frame = 0; frame < 10; ++frame) recorded.run_frame(), plain.run_frame();
    for (auto _ : state) {
      with.push_back(recorded.run_frame());
      without.push_back(plain.run_frame());
    }
  }
  const JournalContents contents = JournalReader(directory).contents();
  // The first frame has the requests that made the world.
  const double frames = static_cast<double>(with.size() + 9), own = frames * users * 48;
  const JournalReader reader(directory);
  state.counters["cpu"] = median(with) / median(without);
  state.counters["bytes"] = static_cast<double>(contents.frames[0].bytes - reader.frame_bytes(0)) / own;
  std::filesystem::remove_all(directory);
}

}  // namespace

void add_journal_benchmarks() {
  for (const JournalSync sync : {JournalSync::always, JournalSync::snapshot, JournalSync::never}) {
    for (const std::uint32_t objects : {4000u, 64'000u}) {
      const std::string name = "limit/journal/" + std::to_string(objects) + '/' + name_of(sync);
      benchmark::RegisterBenchmark(name.c_str(), [=](benchmark::State& state) { run(state, objects, sync); })
          ->Unit(benchmark::kMillisecond)
          ->UseRealTime()
          ->Iterations(objects > 10'000 ? 200 : 1000);
    }
  }
}

}  // namespace ringfence::bench
