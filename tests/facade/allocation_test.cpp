// This is a separate program, because it replaces the global operator new. Its worlds have no support shapes, because
// libccd allocates in each test of such a shape.
#include <algorithm>
#include <array>
#include <atomic>
#include <cstdint>
#include <cstdlib>
#include <cstring>
#include <functional>
#include <memory>
#include <new>
#include <span>
#include <vector>

#include <doctest/doctest.h>

#include "facade/bouncing_world.hpp"
#include "facade/checks.hpp"
#include "ringfence/snapshot.hpp"
#include "ringfence/world.hpp"

namespace {

std::atomic<std::uint64_t> allocations{0};
/// Number of allocations that succeed before one fails; negative: none fails.
std::atomic<std::int64_t> until_failure{-1};
/// If true, all allocations after the failed one fail too, until until_failure is set to a negative number.
std::atomic<bool> keeps_failing{false};

/// Whether this allocation fails. Other threads may allocate or set until_failure at any time, so it is changed only if
/// it still has the value that was tested: otherwise an allocation that overlaps the end of an OutOfMemory could make
/// all later ones fail.
bool is_failing() {
  std::int64_t left = until_failure.load();
  std::int64_t next = 0;
  do {
    if (left < 0) return false;
    next = left > 0 ? left - 1 : keeps_failing.load() ? 0 : -1;
  } while (!until_failure.compare_exchange_weak(left, next));
  return left == 0;
}

void count_allocation() {
  allocations.fetch_add(1, std::memory_order_relaxed);
  if (is_failing()) throw std::bad_alloc();
}

void* allocate(std::size_t bytes) {
  count_allocation();
  if (void* memory = std::malloc(bytes == 0 ? 1 : bytes)) return memory;
  throw std::bad_alloc();
}
void* allocate(std::size_t bytes, std::align_val_t alignment) {
  count_allocation();
  const auto step = static_cast<std::size_t>(alignment);
  if (void* memory = std::aligned_alloc(step, (bytes + step - 1) / step * step)) return memory;
  throw std::bad_alloc();
}

}  // namespace

void* operator new(std::size_t bytes) { return allocate(bytes); }
void* operator new[](std::size_t bytes) { return allocate(bytes); }
void* operator new(std::size_t bytes, std::align_val_t alignment) { return allocate(bytes, alignment); }
void* operator new[](std::size_t bytes, std::align_val_t alignment) { return allocate(bytes, alignment); }
void* operator new(std::size_t bytes, const std::nothrow_t&) noexcept try {
  return allocate(bytes);
} catch (const std::bad_alloc&) {
  return nullptr;
}
void* operator new[](std::size_t bytes, const std::nothrow_t& nothrow) noexcept { return operator new(bytes, nothrow); }
void operator delete(void* memory) noexcept { std::free(memory); }
void operator delete[](void* memory) noexcept { std::free(memory); }
void operator delete(void* memory, std::size_t) noexcept { std::free(memory); }
void operator delete[](void* memory, std::size_t) noexcept { std::free(memory); }
void operator delete(void* memory, std::align_val_t) noexcept { std::free(memory); }
void operator delete[](void* memory, std::align_val_t) noexcept { std::free(memory); }
void operator delete(void* memory, std::size_t, std::align_val_t) noexcept { std::free(memory); }
void operator delete[](void* memory, std::size_t, std::align_val_t) noexcept { std::free(memory); }

namespace ringfence::test {
namespace {

/// Objects move back and forth. After `period` frames everything is as before, so an array that does not grow during
/// one period never grows again.
class PacingModel : public MotionModel {
 public:
  static constexpr std::uint64_t period = 24;
  std::size_t state_bytes() const noexcept override { return 24; }
  void start(const ObjectSpec& spec, std::byte* state) const override {
    std::memcpy(state, &spec.pose.position, sizeof(Vec3d));
  }
  void move(std::uint64_t frame, std::span<const MotionInput> inputs, std::span<MotionOutput> outputs) const override {
    for (std::size_t i = 0; i < inputs.size(); ++i) {
      Vec3d home;
      std::memcpy(&home, inputs[i].state, sizeof home);
      const std::uint64_t phase = (frame + inputs[i].number) % period;
      const double step = static_cast<double>(std::min(phase, period - phase)) * 0.25;
      const double along[3] = {inputs[i].number % 3 == 0 ? step : 0, inputs[i].number % 3 == 1 ? step : 0,
                               inputs[i].number % 3 == 2 ? step : 0};
      outputs[i].pose.position = {home.x + along[0], home.y + along[1], home.z + along[2]};
    }
  }
};

TEST_CASE("in steady state a frame does not allocate, in any deployment and placement") {
  constexpr double side = 16;
  WorldConfig base;
  base.bounds_max = {side, side, side};
  base.user_threads = 2;
  base.interest = 4;
  base.balance = false;  // a new region map is not steady state: a node may get more objects than ever before
  base.motion = std::make_shared<PacingModel>();
  in_all_worlds(base, {0u, 2u, 3u}, [](WorldConfig config) {
    config.deepest_contacts = config.nodes == 2 ? 0 : 1;
    World world(config);
    populate(world, 500, 8, side);
    const ObjectId avatar = world.find(1);
    std::uint64_t handed_over = 0;
    const auto frame = [&] {
      REQUIRE(world.move(UserId(0), avatar, {{side / 2, side / 2, side / 2}, {}}) == Status::ok);
      REQUIRE(world.begin_frame() == Status::ok);
      REQUIRE(world.finish_frame() == Status::ok);
      handed_over += world.report().handed_over;
    };
    for (int k = 0; k < 50; ++k) frame();
    const std::uint64_t before = allocations.load();
    for (int k = 50; k < 100; ++k) frame();
    const std::uint64_t after = allocations.load();
    CHECK(after - before == 0);
    require_counts(world);
    CHECK(world.contacts().size() > 100);
    CHECK(world.report().began > 0);
    CHECK((world.report().unlisted > 0) == (config.deepest_contacts != 0));
    CHECK((handed_over > 0) == (config.deployment == Deployment::user_collision && config.nodes > 0));
  });
}

TEST_CASE("in steady state a frame with the same queries does not allocate") {
  constexpr double side = 16;
  WorldConfig base;
  base.bounds_max = {side, side, side};
  base.balance = false;
  base.motion = std::make_shared<PacingModel>();
  in_all_worlds(base, {0u, 2u}, [](const WorldConfig& config) {
    World world(config);
    const ShapeId ball = world.add_shape(Sphere{1});
    populate(world, 500, 4, side);
    QueryBatch batch;
    for (int i = 0; i < 600; ++i) {
      const Vec3d start{i % 17 * 1.0, i % 13 * 1.0, i % 11 * 1.0};
      const Vec3d away{i % 7 - 3.0, i % 5 - 2.0, 4};
      batch.cast.push_back({start, away});
      batch.cast_any.push_back({start, away});
      batch.cast_all.push_back({start, away});
      batch.sweep.push_back({ball, {start, {}}, away});
      batch.sweep_all.push_back({ball, {start, {}}, away});
      batch.overlap.push_back({ball, {start, {}}});
      batch.nearest.push_back({start, 3});
    }
    const auto frame = [&] {
      REQUIRE(world.attach(batch) == Status::ok);
      REQUIRE(world.advance() == Status::ok);
    };
    for (int k = 0; k < 50; ++k) frame();
    const std::uint64_t before = allocations.load();
    for (int k = 50; k < 80; ++k) frame();
    CHECK(allocations.load() - before == 0);
    CHECK(world.report().recomputed_batches == 0);
    CHECK(batch.answers.cast_all.all().size() > 100);
  });
}

TEST_CASE("in steady state a frame with a history that is asked about does not allocate") {
  constexpr double side = 16;
  WorldConfig base;
  base.bounds_max = {side, side, side};
  base.balance = false;
  base.motion = std::make_shared<PacingModel>();
  base.history = 20;
  in_all_worlds(base, {0u, 2u}, [](const WorldConfig& config) {
    World world(config);
    populate(world, 500, 4, side);
    std::array<Snapshot, 3> kept;
    std::uint64_t in_frames = 0;
    std::size_t found = 0;
    for (std::uint64_t k = 0; k < 120; ++k) {
      const std::uint64_t before = allocations.load();
      REQUIRE(world.advance() == Status::ok);
      if (k >= 70) in_frames += allocations.load() - before;
      Snapshot& snapshot = kept[k % kept.size()] = world.snapshot();
      std::vector<RayQuery> rays;
      for (double frame = static_cast<double>(snapshot.oldest_frame()); frame <= static_cast<double>(k); frame += 0.5) {
        rays.push_back({.start = {0, 0, 0}, .displacement = {side, side, side}, .frame = frame});
      }
      std::vector<Hit> hits(rays.size());
      snapshot.cast(rays, hits);
      for (const Hit& hit : hits) found += hit ? 1 : 0;
    }
    CHECK(in_frames == 0);
    CHECK(found > 100);
  });
}

/// Makes allocations fail during its lifetime.
class OutOfMemory {
 public:
  OutOfMemory(std::int64_t succeed_first, bool keep_failing) {
    keeps_failing.store(keep_failing);
    until_failure.store(succeed_first);
  }
  ~OutOfMemory() { until_failure.store(-1); }
  OutOfMemory(const OutOfMemory&) = delete;
  OutOfMemory& operator=(const OutOfMemory&) = delete;
};

/// Runs a few frames in which all arrays grow, users and nodes join and leave, and objects are spawned and removed.
/// Returns the first status that is not ok. `after_frame` is called after each complete frame.
Status run_frames(
    World& world, std::size_t spawns, const std::function<void()>& after_frame = [] {}) {
  constexpr double side = 6;
  const auto spawn = [&](std::size_t i) {
    ObjectSpec spec;
    spec.category = i % 3 == 0 ? Category::avatar : Category::active;
    spec.user = spec.category == Category::avatar ? UserId(static_cast<std::uint32_t>(i % 2)) : no_user;
    const double x = static_cast<double>(i % 7) * 0.9;
    spec.pose.position = {x, static_cast<double>(i / 7 % 6), side / 2};
    return world.spawn(spec).status;
  };
  Status status = Status::ok;
  const auto is_ok = [&](Status returned) { return (status = returned) == Status::ok; };
  if (!is_ok(world.connect(UserId(0)).status) || !is_ok(world.connect(UserId(1)).status)) return status;
  for (std::size_t i = 0; i < spawns; ++i) {
    if (!is_ok(spawn(i))) return status;
  }
  const auto advances = [&] {
    if (!is_ok(world.advance())) return false;
    after_frame();
    return true;
  };
  if (!advances()) return status;
  if (!is_ok(world.resize(2))) return status;
  if (!is_ok(world.disconnect(UserId(1))) || !advances()) return status;
  if (!is_ok(world.resize(1))) return status;
  for (int frame = 0; frame < 2; ++frame) {
    if (!advances()) return status;
  }
  return status;
}

/// A number that depends on every contact.
std::uint64_t digest_of(std::span<const Contact> contacts) {
  std::uint64_t digest = contacts.size();
  for (const Contact& contact : contacts) {
    std::uint64_t depth = 0;
    std::memcpy(&depth, &contact.depth, sizeof contact.depth);
    for (const std::uint64_t word : {std::uint64_t{contact.a}, std::uint64_t{contact.b}, depth}) {
      digest = (digest ^ word) * 0x9e3779b97f4a7c15u;
    }
  }
  return digest;
}

TEST_CASE("a failed allocation in a call or a frame returns out_of_memory, and the World can be destroyed") {
  for (const bool keep_failing : {false, true}) {
    for (const Placement placement : {Placement::server, Placement::region}) {
      for (const std::uint32_t nodes : {0u, 1u, 3u}) {
        WorldConfig config;
        config.nodes = nodes;
        config.placement = placement;
        config.bounds_max = {6, 6, 6};
        config.interest = 3;
        config.timeline = placement == Placement::region;
        config.capacities = {1, 1, 1, 1};
        config.deepest_contacts = nodes == 1 ? 0 : 1;
        config.motion = std::make_shared<BouncingModel>(6);
        CAPTURE(describe(config));
        CAPTURE(keep_failing);
        // Without threads one frame of contacts is kept, and few allocations can damage it.
        const bool exhaustive = nodes == 0 && !keep_failing;
        std::int64_t failing = 0;
        std::size_t failed = 0;
        for (bool complete = false; !complete; failing += exhaustive ? 1 : 1 + failing / 10) {
          CAPTURE(failing);
          World world(config);
          world.add_shape(Sphere{0.7f});
          Status status;
          std::uint64_t last = digest_of({}), frames = 0;
          const std::function<void()> note_last = [&] {
            last = digest_of(world.contacts());
            frames = world.frames();
          };
          {
            const OutOfMemory out_of_memory(failing, keep_failing);
            status = run_frames(world, 60, note_last);
          }
          complete = status == Status::ok;
          if (complete) continue;
          ++failed;
          REQUIRE(status == Status::out_of_memory);
          // The results of the last complete frame can be read; no other frame runs.
          // A frame may be complete, and finish_frame fails after that.
          CHECK((digest_of(world.contacts()) == last || world.frames() == frames + 1));
          CHECK(world.begin_frame() == Status::out_of_memory);
          CHECK(world.finish_frame() == Status::out_of_memory);
          CHECK(world.advance() == Status::out_of_memory);
          CHECK(world.spawn({}).status == Status::out_of_memory);
          CHECK(world.connect().status == Status::out_of_memory);
          CHECK(world.disconnect(UserId(0)) == Status::out_of_memory);
          CHECK(world.resize(1) == Status::out_of_memory);
          CHECK(world.seen_by(UserId(0)).empty());
          CHECK_THROWS_AS(world.add_shape(Sphere{1}), Error);
        }
        CHECK(failed > 20);
      }
    }
  }
}

TEST_CASE("a World can be destroyed when an allocation fails in a running frame") {
  for (const std::uint32_t nodes : {0u, 3u}) {
    for (std::int64_t failing = 0; failing < 40; ++failing) {
      CAPTURE(failing);
      WorldConfig config;
      config.nodes = nodes;
      config.capacities = {1, 1, 1, 1};
      config.motion = std::make_shared<BouncingModel>(6);
      auto world = std::make_unique<World>(config);
      populate(*world, 60, 4, 6);
      REQUIRE(world->begin_frame() == Status::ok);
      const OutOfMemory out_of_memory(failing, false);
      world.reset();  // finishes the frame, or stops it
    }
  }
}

}  // namespace
}  // namespace ringfence::test
