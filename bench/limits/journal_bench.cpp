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

/// Measures what a recorder takes of the thread that calls World. World::begin_frame first collects the inputs of the
/// frame and calls the recorder, so its part begins with the frame.
class TimedRecorder final : public Recorder {
 public:
  explicit TimedRecorder(std::shared_ptr<Recorder> recorder) : recorder_(std::move(recorder)) {}
  bool begin_frame(World& world, std::span<const std::byte> inputs) override {
    const bool recorded = recorder_->begin_frame(world, inputs);
    spent_ms_ = thread_cpu_ms() - frame_began_;
    return recorded;
  }
  bool finish_frame(World& world, bool reproducible) override {
    const double began = thread_cpu_ms();
    const bool recorded = recorder_->finish_frame(world, reproducible);
    spent_ms_ += thread_cpu_ms() - began;
    return recorded;
  }
  void note_begin(double cpu_ms) noexcept { frame_began_ = cpu_ms; }
  /// CPU milliseconds of the last frame.
  double spent_ms() const noexcept { return spent_ms_; }

 private:
  std::shared_ptr<Recorder> recorder_;
  double frame_began_ = 0, spent_ms_ = 0;
};

/// A world of the paper's kind, in which each of 1000 users has an avatar.
class Crowd {
 public:
  Crowd(std::uint32_t objects, std::shared_ptr<TimedRecorder> recorder) : recorder_(std::move(recorder)), random_(1) {
    WorldConfig config;
    config.nodes = 0;
    motion::SteeringConfig steering;
    const double side = 4 * std::cbrt(objects);
    steering.bounds_max = config.bounds_max = {side, side, side};
    steering.targets = std::max(1u, objects / 50);
    config.motion = std::make_shared<motion::Steering>(steering);
    config.capacities.objects = objects;
    config.capacities.users = users;
    config.recorder = recorder_;
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
    if (recorder_ != nullptr) recorder_->note_begin(begin);
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

  std::shared_ptr<TimedRecorder> recorder_;
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
  std::vector<double> with, without, shares;
  {
    auto recorder = std::make_shared<TimedRecorder>(Journal::create(config));
    Crowd recorded(objects, recorder), plain(objects, nullptr);
    for (int frame = 0; frame < 10; ++frame) recorded.run_frame(), plain.run_frame();
    for (auto _ : state) {
      with.push_back(recorded.run_frame());
      shares.push_back(recorder->spent_ms() / (with.back() - recorder->spent_ms()));
      without.push_back(plain.run_frame());
    }
  }
  const JournalContents contents = JournalReader(directory).contents();
  // The first frame has the requests that made the world.
  const double frames = static_cast<double>(with.size() + 9), own = frames * users * 48;
  const JournalReader reader(directory);
  state.counters["cpu"] = median(with) / median(without);
  state.counters["recorder"] = median(shares);  // without the noise between two worlds
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
