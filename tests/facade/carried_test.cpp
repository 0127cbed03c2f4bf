// Results of pairs of which neither object has changed are carried over from the frame before.
#include <cmath>
#include <cstdint>
#include <cstring>
#include <memory>
#include <random>
#include <string>
#include <vector>

#include <doctest/doctest.h>

#include "facade/checks.hpp"
#include "ringfence/world.hpp"

namespace ringfence::test {
namespace {

constexpr double side = 20;

// Moves each object for eight frames in eighty, so that most rest, and all of them move and rest again.
class Sleepers : public MotionModel {
 public:
  bool uses_contacts() const noexcept override { return false; }
  void move(std::uint64_t frame, std::span<const MotionInput> inputs, std::span<MotionOutput> outputs) const override {
    for (std::size_t i = 0; i < inputs.size(); ++i) {
      if ((frame / 8 + inputs[i].number) % 10 == 0) outputs[i].pose.position.z += frame % 2 == 0 ? 0.25 : -0.125;
    }
  }
};

class Ball : public SupportFunction {
 public:
  Vec3f support(Vec3f d) const override {
    const float scale = 0.8f / std::sqrt(d.x * d.x + d.y * d.y + d.z * d.z);
    return {d.x * scale, d.y * scale, d.z * scale};
  }
};

std::vector<ShapeId> add_shapes(World& world) {
  const std::vector<Vec3f> corners{{-0.8f, -0.8f, -0.5f}, {0.8f, -0.8f, -0.5f}, {0, 0.8f, -0.5f}, {0, 0, 0.8f}};
  const TriangleMesh tent{corners, {0, 1, 3, 1, 2, 3, 2, 0, 3}};
  return {world.add_shape(Sphere{0.8f}),
          world.add_shape(Box{{0.6f, 0.7f, 0.8f}}),
          world.add_shape(Capsule{0.5f, 0.6f}),
          world.add_shape(ConvexHull{corners}),
          world.add_shape(tent),
          world.add_shape(SupportShape{std::make_shared<Ball>()})};
}

std::uint64_t support_candidates(const FrameReport& report) {
  std::uint64_t candidates = 0;
  for (const KindReport& kind : report.kinds) candidates += kind.second == ShapeKind::support ? kind.candidates : 0;
  return candidates;
}

// Two worlds that receive the same requests: one carries results over, the other treats all objects as moving.
class Twins {
 public:
  Twins(std::uint32_t nodes, std::uint64_t seed) : random_(seed) {
    WorldConfig config;
    config.nodes = nodes;
    config.placement = Placement::region;
    config.bounds_max = {side, side, side};
    config.motion = std::make_shared<Sleepers>();
    config.layers.names = {"solid", "ghost"};
    config.layers.collide = {{0, 0}};
    for (auto& world : worlds_) {
      world = std::make_unique<World>(config);
      shapes_ = add_shapes(*world);
      config.tuning.keep_resting = false;
    }
    for (int i = 0; i < 300; ++i) spawn();
  }

  /// A few changes, the same in both.
  void change() {
    const std::uint64_t draw = random_();
    const ObjectId id = ids_[random_() % ids_.size()];
    const Pose pose = any_pose();
    const ShapeId shape = shapes_[random_() % shapes_.size()];
    const std::uint64_t value = random_() % 2;
    switch (draw % 7) {
      case 0:
        return both([&](World& world) { return world.place(id, pose); });
      case 1:
        return both([&](World& world) { return world.set_shape(id, shape); });
      case 2:
        return both([&](World& world) { return world.set_group(id, static_cast<std::uint32_t>(value)); });
      case 3:
        return both([&](World& world) { return world.set_layer(id, static_cast<std::uint8_t>(value)); });
      case 4:
        return both([&](World& world) { return world.set_enabled(id, value != 0); });
      case 5:
        both([&](World& world) { return world.destroy(id); });
        std::erase(ids_, id);
        return;
      default:
        return spawn();
    }
  }

  void resize(std::uint32_t nodes) {
    both([&](World& world) { return world.resize(nodes); });
  }

  void advance_and_compare() {
    both([](World& world) { return world.advance(); });
    const World &carrying = *worlds_[0], &testing = *worlds_[1];
    require_counts(carrying);
    require_counts(testing);
    REQUIRE(carrying.report().candidates == testing.report().candidates);
    REQUIRE(testing.report().carried == 0);
    // A failure of a support function has to be noticed in each frame.
    REQUIRE(support_candidates(carrying.report()) == support_candidates(testing.report()));
    const auto expected = testing.contacts(), found = carrying.contacts();
    REQUIRE(found.size() == expected.size());
    REQUIRE(std::memcmp(found.data(), expected.data(), expected.size_bytes()) == 0);
    carried += carrying.report().carried;
    candidates += carrying.report().candidates;
  }

  std::mt19937_64& random() { return random_; }
  std::uint64_t carried = 0, candidates = 0;

 private:
  template <class Request>
  void both(Request request) {
    for (const auto& world : worlds_) REQUIRE(request(*world) == Status::ok);
  }
  Pose any_pose() {
    std::uniform_real_distribution<double> anywhere(0, side);
    const double x = anywhere(random_), y = anywhere(random_), z = anywhere(random_);
    return {{x, y, z}, {}};
  }
  void spawn() {
    const ObjectSpec spec{.shape = shapes_[random_() % shapes_.size()], .pose = any_pose()};
    ObjectId id;
    for (const auto& world : worlds_) id = world->spawn(spec).id;
    ids_.push_back(id);
  }

  std::mt19937_64 random_;
  std::unique_ptr<World> worlds_[2];
  std::vector<ShapeId> shapes_;
  std::vector<ObjectId> ids_;
};

TEST_CASE("contacts of resting pairs are carried over, and are those of a new test, bit for bit") {
  for (const std::uint32_t nodes : {0u, 1u, 3u}) {
    const std::uint64_t seed = 40 + nodes;
    CAPTURE(nodes);
    CAPTURE(seed);
    Twins twins(nodes, seed);
    for (int frame = 0; frame < 96; ++frame) {
      CAPTURE(frame);
      for (std::uint64_t n = twins.random()() % 4; n > 0; --n) twins.change();
      if (nodes != 0 && frame % 30 == 29) twins.resize(static_cast<std::uint32_t>(1 + twins.random()() % 4));
      twins.advance_and_compare();
    }
    CHECK(twins.carried > twins.candidates / 8);
  }
}

TEST_CASE(
    "in a world where nothing moves, all pairs are carried over from the third frame on, and still have contacts") {
  WorldConfig config;
  config.nodes = 0;
  config.bounds_max = {side, side, side};
  World world(config);
  const ShapeId ball = world.add_shape(Sphere{0.75f});
  for (int i = 0; i < 20; ++i)
    REQUIRE(world.spawn({.shape = ball, .pose = {{1.0 + i, 1, 1}, {}}}).status == Status::ok);
  for (int frame = 0; frame < 6; ++frame) {
    REQUIRE(world.advance() == Status::ok);
    require_counts(world);
    CHECK(world.contacts().size() == 19);
    if (frame >= 2) {
      CHECK(world.report().tested == 0);
      CHECK(world.report().carried == 19);
      CHECK(world.contacts()[0].phase == Phase::persist);
    }
  }
}

}  // namespace
}  // namespace ringfence::test
