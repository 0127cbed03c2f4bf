#include <algorithm>
#include <cmath>
#include <cstdint>
#include <fstream>
#include <functional>
#include <memory>
#include <random>
#include <string>
#include <vector>

#include <benchmark/benchmark.h>

#include "item_reporter.hpp"
#include "journal_bench.hpp"
#include "ringfence/world.hpp"
#include "telemetry/clock.hpp"

// Benchmarks limit/<world>: the median time of a frame in worlds that are not as they should be, each beside the same
// world as it should be. limit/far/<n>/<metres>/<bounds>: spheres far from the origin, with bounds there or not; with
// /nodes2 by two CD nodes instead of the calling thread.
// limit/wide/<n>/<bounds>: spheres over 2 km. limit/users/<n>: users who are not near each other, with memory.
// limit/avatars/<n>: n avatars of one user on one spot, and 4000 other objects.
//
// limit/save/<n>, limit/restore/<n>: the time to save a world of n objects to memory, and to restore it from there,
// without contacts, and with one shape; `bytes` is the size of the save by object.

namespace ringfence::bench {
namespace {

// Moves each object to and fro, so that none rests.
class Trembling : public MotionModel {
 public:
  bool uses_contacts() const noexcept override { return false; }
  void move(std::uint64_t frame, std::span<const MotionInput> inputs, std::span<MotionOutput> outputs) const override {
    for (std::size_t i = 0; i < inputs.size(); ++i) outputs[i].pose.position.x += frame % 2 == 0 ? 0.0625 : -0.0625;
  }
};

double resident_megabytes() {
  std::ifstream status("/proc/self/status");
  for (std::string line; std::getline(status, line);) {
    if (line.rfind("VmRSS:", 0) == 0) return std::stod(line.substr(6)) / 1024;
  }
  return 0;
}

WorldConfig config_of(std::uint32_t nodes) {
  WorldConfig config;
  config.nodes = nodes;
  config.motion = std::make_shared<Trembling>();
  config.capacities.objects = 70'000;
  config.capacities.users = 65'536;
  return config;
}

void set_cube(WorldConfig& config, double low, double side) {
  config.bounds_min = {low, low, low};
  config.bounds_max = {low + side, low + side, low + side};
}

void measure(benchmark::State& state, World& world) {
  constexpr int settled = 20;
  for (int i = 0; i < settled; ++i) (void)world.advance();
  std::vector<std::uint64_t> times;
  for (auto _ : state) {
    const std::uint64_t start = telemetry::now_ns();
    if (world.advance() != Status::ok) return state.SkipWithError("a frame failed");
    times.push_back(telemetry::now_ns() - start);
  }
  std::nth_element(times.begin(), times.begin() + static_cast<std::ptrdiff_t>(times.size() / 2), times.end());
  state.counters["median_ms"] = telemetry::to_ms(times[times.size() / 2]);
  state.counters["candidates"] = static_cast<double>(world.report().candidates);
  state.counters["contacts"] = static_cast<double>(world.contacts().size());
}

// A cubic lattice with 3 m between spheres of 1 m, so that none are in contact.
void run_far(benchmark::State& state, std::uint32_t count, double metres, bool right_bounds, std::uint32_t nodes) {
  const auto row = static_cast<std::uint32_t>(std::ceil(std::cbrt(count)));
  WorldConfig config = config_of(nodes);
  set_cube(config, right_bounds ? metres : 0, right_bounds ? 3.0 * row : 100);
  World world(config);
  const ShapeId ball = world.add_shape(Sphere{1});
  for (std::uint32_t i = 0; i < count; ++i) {
    const auto at = [&](std::uint32_t k) { return metres + 1 + 3.0 * (k % row); };
    (void)world.spawn({.shape = ball, .pose = {{at(i), at(i / row), at(i / row / row)}, {}}});
  }
  measure(state, world);
}

void run_wide(benchmark::State& state, std::uint32_t count, bool right_bounds) {
  WorldConfig config = config_of(0);
  if (right_bounds) config.bounds_max = {2000, 2000, 20};
  World world(config);
  const ShapeId ball = world.add_shape(Sphere{0.5f});
  std::mt19937_64 random(1);
  std::uniform_real_distribution<double> across(0, 2000), high(0, 20);
  for (std::uint32_t i = 0; i < count; ++i) {
    const double x = across(random), y = across(random), z = high(random);
    (void)world.spawn({.shape = ball, .pose = {{x, y, z}, {}}});
  }
  measure(state, world);
}

void run_users(benchmark::State& state, std::uint32_t users) {
  constexpr double apart = 60;
  const double before = resident_megabytes();
  const auto row = static_cast<std::uint32_t>(std::ceil(std::sqrt(users)));
  WorldConfig config = config_of(1);
  config.bounds_max = {apart * row, apart * row, 10};
  World world(config);
  const ShapeId ball = world.add_shape(Sphere{0.5f});
  for (std::uint32_t i = 0; i < users; ++i) {
    const Vec3d at{apart * (i % row) + apart / 2, apart * (i / row) + apart / 2, 5};
    (void)world.spawn({.shape = ball, .category = Category::avatar, .user = world.connect().user, .pose = {at, {}}});
  }
  measure(state, world);
  state.counters["megabytes"] = resident_megabytes() - before;
}

void run_avatars(benchmark::State& state, std::uint32_t avatars) {
  constexpr double side = 50;
  WorldConfig config = config_of(2);
  set_cube(config, 0, side);
  World world(config);
  const ShapeId ball = world.add_shape(Sphere{0.5f});
  std::mt19937_64 random(1);
  std::uniform_real_distribution<double> within(0, side);
  for (int i = 0; i < 4000; ++i) {
    const double x = within(random), y = within(random), z = within(random);
    (void)world.spawn({.shape = ball, .pose = {{x, y, z}, {}}});
  }
  const UserId user = world.connect().user;
  for (std::uint32_t i = 0; i < avatars; ++i) {
    (void)world.spawn(
        {.shape = ball, .category = Category::avatar, .user = user, .pose = {{side / 2, side / 2, side / 2}, {}}});
  }
  measure(state, world);
}

// The same movement, with as much state as the model of the paper's world.
class TremblingWithState final : public Trembling {
 public:
  std::size_t state_bytes() const noexcept override { return 48; }
};

void run_save(benchmark::State& state, std::uint32_t count, bool restore) {
  const auto row = static_cast<std::uint32_t>(std::ceil(std::cbrt(count)));
  WorldConfig config = config_of(0);
  config.motion = std::make_shared<TremblingWithState>();
  World world(config);
  const ShapeId ball = world.add_shape(Sphere{1});
  for (std::uint32_t i = 0; i < count; ++i) {
    const auto at = [&](std::uint32_t k) { return 3.0 * (k % row); };
    (void)world.spawn({.shape = ball, .pose = {{at(i), at(i / row), at(i / row / row)}, {}}});
  }
  for (int frame = 0; frame < 3; ++frame) (void)world.advance();
  MemorySink saved;
  if (world.save(saved) != Status::ok) return state.SkipWithError("the world was not saved");
  std::vector<std::uint64_t> times;
  for (auto _ : state) {
    MemorySink sink;
    MemorySource source(saved.bytes());
    const std::uint64_t start = telemetry::now_ns();
    if (restore) {
      const World restored(config, source);
      times.push_back(telemetry::now_ns() - start);
    } else {
      if (world.save(sink) != Status::ok) return state.SkipWithError("the world was not saved");
      times.push_back(telemetry::now_ns() - start);
    }
  }
  std::nth_element(times.begin(), times.begin() + static_cast<std::ptrdiff_t>(times.size() / 2), times.end());
  state.counters["median_ms"] = telemetry::to_ms(times[times.size() / 2]);
  state.counters["bytes"] = static_cast<double>(saved.bytes().size()) / count;
}

void add(const std::string& name, std::function<void(benchmark::State&)> run) {
  benchmark::RegisterBenchmark(name.c_str(), std::move(run))->Unit(benchmark::kMillisecond)->UseRealTime();
}

}  // namespace
}  // namespace ringfence::bench

int main(int argc, char** argv) {
  using namespace ringfence::bench;
  benchmark::Initialize(&argc, argv);
  if (benchmark::ReportUnrecognizedArguments(argc, argv)) return 2;
  for (const bool right : {false, true}) {
    const std::string bounds = right ? "bounds" : "no_bounds";
    for (const double metres : {1e3, 1e5}) {
      const std::string name = "limit/far/3000/" + std::to_string(static_cast<int>(metres)) + '/' + bounds;
      add(name, [=](benchmark::State& state) { run_far(state, 3000, metres, right, 0); });
      add(name + "/nodes2", [=](benchmark::State& state) { run_far(state, 3000, metres, right, 2); });
    }
    add("limit/wide/4000/" + bounds, [=](benchmark::State& state) { run_wide(state, 4000, right); });
  }
  for (const std::uint32_t users : {1000u, 4000u, 16'000u, 65'536u}) {
    add("limit/users/" + std::to_string(users), [=](benchmark::State& state) { run_users(state, users); });
  }
  for (const std::uint32_t avatars : {0u, 1000u}) {
    add("limit/avatars/" + std::to_string(avatars), [=](benchmark::State& state) { run_avatars(state, avatars); });
  }
  for (const std::uint32_t objects : {4000u, 64'000u}) {
    add("limit/save/" + std::to_string(objects), [=](benchmark::State& state) { run_save(state, objects, false); });
    add("limit/restore/" + std::to_string(objects), [=](benchmark::State& state) { run_save(state, objects, true); });
  }
  add_journal_benchmarks();
  return run_benchmarks();
}
