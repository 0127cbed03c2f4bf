// A separate program, because it replaces the global operator new. Without support shapes: libccd allocates in each of
// their tests.
#include <algorithm>
#include <atomic>
#include <cstdint>
#include <cstdlib>
#include <cstring>
#include <new>

#include <doctest/doctest.h>

#include "facade/bouncing_world.hpp"
#include "facade/checks.hpp"
#include "ringfence/world.hpp"

namespace {

std::atomic<std::uint64_t> allocations{0};

void* allocate(std::size_t bytes) {
  allocations.fetch_add(1, std::memory_order_relaxed);
  if (void* memory = std::malloc(bytes == 0 ? 1 : bytes)) return memory;
  throw std::bad_alloc();
}
void* allocate(std::size_t bytes, std::align_val_t alignment) {
  allocations.fetch_add(1, std::memory_order_relaxed);
  const auto step = static_cast<std::size_t>(alignment);
  if (void* memory = std::aligned_alloc(step, (bytes + step - 1) / step * step)) return memory;
  throw std::bad_alloc();
}

}  // namespace

void* operator new(std::size_t bytes) { return allocate(bytes); }
void* operator new[](std::size_t bytes) { return allocate(bytes); }
void* operator new(std::size_t bytes, std::align_val_t alignment) { return allocate(bytes, alignment); }
void* operator new[](std::size_t bytes, std::align_val_t alignment) { return allocate(bytes, alignment); }
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

/// Objects walk to and fro: after `period` frames everything is as before, so what did not grow in one period never
/// will.
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
  in_all_worlds(base, {0u, 2u}, [](const WorldConfig& config) {
    World world(config);
    populate(world, 500, 8, side);
    const ObjectId avatar = world.find(1);
    std::uint64_t handed_over = 0;
    const auto frame = [&] {
      world.move(0, avatar, {{side / 2, side / 2, side / 2}, {}});
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
    CHECK((handed_over > 0) == (config.deployment == Deployment::user_collision && config.nodes > 0));
  });
}

}  // namespace
}  // namespace ringfence::test
