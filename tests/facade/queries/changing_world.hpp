#pragma once

#include <cmath>
#include <cstdint>
#include <map>
#include <memory>
#include <random>
#include <set>
#include <span>
#include <utility>
#include <vector>

#include <doctest/doctest.h>

#include "facade/bouncing_world.hpp"
#include "facade/checks.hpp"
#include "queries/interpolate.hpp"
#include "ringfence/world.hpp"

// Worlds with a history, for tests of queries about it.

namespace ringfence::test {

inline constexpr double cube_side = 16;

inline WorldConfig world_with_history(std::uint32_t frames) {
  WorldConfig config;
  config.bounds_max = {cube_side, cube_side, cube_side};
  config.motion = std::make_shared<BouncingModel>(cube_side);
  config.history = frames;
  return config;
}

/// Moves each object by its own speed, and lets some jump.
class JumpingModel : public MotionModel {
 public:
  static bool jumps(ObjectNumber number, std::uint64_t frame) { return (number + frame) % 11 == 0; }
  void move(std::uint64_t frame, std::span<const MotionInput> inputs, std::span<MotionOutput> outputs) const override {
    for (std::size_t i = 0; i < inputs.size(); ++i) {
      const MotionInput& in = inputs[i];
      Pose& pose = outputs[i].pose;
      const bool jump = jumps(in.number, frame);
      const double step = jump ? 6 : 0.1 * (in.number % 9);
      pose.position.x += in.number % 2 == 0 ? step : -step;
      pose.position.y += jump ? 0 : 0.3;
      if (pose.position.x > cube_side) pose.position.x -= 4;
      const float turn = 0.1f * static_cast<float>(in.number % 5);
      pose.orientation = {std::sin(turn * static_cast<float>(frame)), 0, 0, std::cos(turn * static_cast<float>(frame))};
      outputs[i].jump = jump;
    }
  }
};

/// A world in which objects are placed, disabled, spawned, destroyed and change their shapes, and who jumped in the
/// last frame.
struct ChangingWorld {
  ChangingWorld(const WorldConfig& config, unsigned seed) : world(config), random(seed) {
    shapes = {world.add_shape(Sphere{0.7f}), world.add_shape(Box{{0.6f, 0.8f, 0.5f}}),
              world.add_shape(Capsule{0.4f, 0.6f})};
    REQUIRE(world.connect().status == Status::ok);
    for (int i = 0; i < 60; ++i) spawn();
  }
  Pose anywhere() {
    const auto at = [&] { return static_cast<double>(random() % 1000) * cube_side / 1000; };
    return {{at(), at(), at()}, {}};
  }
  void spawn() {
    const std::uint64_t kind = random() % 8;
    ObjectSpec spec;
    spec.shape = shapes[random() % shapes.size()];
    spec.category = kind == 0 ? Category::fixed : kind == 1 ? Category::avatar : Category::active;
    if (kind == 1) spec.user = UserId(0);
    spec.pose = anywhere();
    const Spawned spawned = world.spawn(spec);
    REQUIRE(spawned.status == Status::ok);
    live.push_back({spawned.id, spec.category});
  }
  void run_frame() {
    placed.clear();
    for (int i = 0; i < 6; ++i) {
      const auto [id, category] = live[random() % live.size()];
      const std::uint64_t draw = random() % 4;
      if (draw == 0) REQUIRE(world.set_shape(id, shapes[random() % shapes.size()]) == Status::ok);
      if (category == Category::fixed) continue;
      if (draw == 1) {
        REQUIRE(world.set_enabled(id, !world.object(id).spec.enabled) == Status::ok);
        placed.insert(id.number());  // if it is enabled again in the same frame
      }
      if (draw == 2) {
        REQUIRE(world.place(id, anywhere()) == Status::ok);
        placed.insert(id.number());
      }
    }
    spawn();
    const std::size_t gone = random() % live.size();
    REQUIRE(world.destroy(live[gone].first) == Status::ok);
    live.erase(live.begin() + static_cast<std::ptrdiff_t>(gone));
    advance(world);
  }

  World world;
  std::mt19937_64 random;
  std::vector<ShapeId> shapes;
  std::vector<std::pair<ObjectId, Category>> live;
  std::set<ObjectNumber> placed;
};

/// The objects at a time between two frames, by the rules of QueryFrame.
inline std::vector<ObjectView> between(const std::vector<ObjectView>& earlier, const std::vector<ObjectView>& later,
                                       const std::set<ObjectNumber>& placed, std::uint64_t later_frame,
                                       double fraction) {
  std::map<std::uint64_t, ObjectSpec> then;
  for (const ObjectView& view : later) then[view.id.value] = view.spec;
  std::vector<ObjectView> out = earlier;
  for (ObjectView& view : out) {
    const auto found = then.find(view.id.value);
    if (found == then.end() || !found->second.enabled || found->second.shape != view.spec.shape ||
        placed.contains(view.id.number()) ||
        (view.spec.category != Category::fixed && JumpingModel::jumps(view.id.number(), later_frame))) {
      continue;
    }
    view.spec.pose = queries::interpolate(view.spec.pose, found->second.pose, fraction);
  }
  return out;
}

}  // namespace ringfence::test
