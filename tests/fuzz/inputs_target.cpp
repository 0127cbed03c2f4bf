// Property: any bytes as the recorded inputs of a frame, as an attacker writes them into a journal, are either refused,
// or the world runs with them and can be saved and restored.
#include <memory>
#include <span>
#include <vector>

#include "fuzz/target.hpp"
#include "ringfence/error.hpp"
#include "ringfence/world.hpp"

namespace ringfence::fuzz {
namespace {

class Drift : public MotionModel {
 public:
  std::size_t state_bytes() const noexcept override { return 8; }
  void move(std::uint64_t, std::span<const MotionInput> inputs, std::span<MotionOutput> outputs) const override {
    for (std::size_t i = 0; i < inputs.size(); ++i) {
      outputs[i].pose.position.x += inputs[i].input.empty() ? 0.25 : 0.5;
    }
  }
};

WorldConfig config() {
  static const auto model = std::make_shared<Drift>();
  WorldConfig config;
  config.nodes = 0;
  config.bounds_min = {-10, -10, -10};
  config.bounds_max = {10, 10, 10};
  config.layers = {{"a", "b"}, {{0, 0}, {0, 1}}};
  config.motion = model;
  config.limits = {.objects = 4096, .users = 64};
  config.capacities.users = 64;
  return config;
}

/// A world with two shapes, two users, one of which is leaving, three objects and a request for the next frame.
std::vector<std::byte> make_save() {
  World world(config());
  const ShapeId ball = world.add_shape(Sphere{1}), box = world.add_shape(Box{{1, 1, 1}});
  const UserId user = world.connect().user, other = world.connect().user;
  require(world.spawn({.shape = ball, .category = Category::avatar, .user = user}).status == Status::ok);
  require(world.spawn({.shape = box, .category = Category::avatar, .user = other}).status == Status::ok);
  require(world.spawn({.shape = box, .pose = {{1, 0, 0}, {}}}).status == Status::ok);
  require(world.advance() == Status::ok);
  MemorySink sink;
  require(world.save(sink) == Status::ok);
  return sink.take();
}

void check(std::span<const std::byte> inputs) {
  static const std::vector<std::byte> save = make_save();
  MemorySource source(save);
  World world(config(), source);
  const Status applied = world.apply(inputs);
  if (applied == Status::bad_message) {
    return;
  }
  require(applied == Status::ok);
  for (int frame = 0; frame < 2; ++frame) {
    require(world.advance() == Status::ok);
  }
  MemorySink sink;
  require(world.save(sink) == Status::ok);
  MemorySource again(sink.bytes());
  const World same(config(), again);
  require(same.contacts().size() == world.contacts().size());
}

}  // namespace
}  // namespace ringfence::fuzz

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* input, std::size_t size) {
  ringfence::fuzz::check({reinterpret_cast<const std::byte*>(input), size});
  return 0;
}
