// Queries about earlier frames, and about the time between two.
#include <limits>
#include <map>
#include <random>
#include <set>
#include <vector>

#include <doctest/doctest.h>

#include "facade/bouncing_world.hpp"
#include "facade/checks.hpp"
#include "facade/queries/all_objects.hpp"
#include "facade/queries/random_queries.hpp"
#include "facade/script.hpp"
#include "queries/frame_object.hpp"
#include "ringfence/world.hpp"

namespace ringfence::test {
namespace {

constexpr double side = 16;

WorldConfig world_with_history(std::uint32_t frames) {
  WorldConfig config;
  config.bounds_max = {side, side, side};
  config.motion = std::make_shared<BouncingModel>(side);
  config.history = frames;
  return config;
}

std::vector<ShapeId> all_shapes(const World& world) {
  std::vector<ShapeId> out;
  for (std::uint32_t i = 0; i < world.shape_count(); ++i) out.emplace_back(i);
  return out;
}

TEST_CASE("a query about a frame of the history has the bits that it had when that frame was the last") {
  constexpr std::uint64_t history = 5;
  in_all_worlds(world_with_history(history), {0u, 2u}, [&](const WorldConfig& config) {
    World world(config);
    Script script(world, 3, side);
    script.make_requests();
    advance(world);
    const Queries queries = make_queries(world, all_shapes(world), side, 6, 1);
    std::vector<Answers> then;
    for (std::uint64_t frame = 0; frame < 12; ++frame) {
      const Snapshot snapshot = world.snapshot();
      REQUIRE(snapshot.frame() == frame);
      CHECK(snapshot.oldest_frame() == (frame < history ? 0 : frame - history));
      then.push_back(answer(snapshot, queries));
      for (std::uint64_t asked = 0; asked <= frame; ++asked) {
        const Answers now = answer(snapshot, about(queries, static_cast<double>(asked)));
        if (asked >= snapshot.oldest_frame()) {
          CHECK((now == then[asked]));
        } else {
          CHECK(now.hits.front().status == Status::frame_expired);
        }
      }
      script.make_requests();
      advance(world);
    }
  });
}

TEST_CASE("a frame that is not there is refused") {
  World world(world_with_history(2));
  const ShapeId ball = world.add_shape(Sphere{1});
  REQUIRE(world.spawn({.shape = ball, .category = Category::fixed, .pose = {{1, 2, 3}, {}}}).status == Status::ok);
  for (int i = 0; i < 5; ++i) REQUIRE(world.advance() == Status::ok);
  const Snapshot snapshot = world.snapshot();
  const auto status = [&](double frame) {
    return snapshot.cast({.start = {-9, 2, 3}, .displacement = {20, 0, 0}, .frame = frame}).status;
  };
  CHECK(status(4) == Status::ok);
  CHECK(status(3.25) == Status::ok);
  CHECK(status(2) == Status::ok);
  CHECK(status(1.999) == Status::frame_expired);
  CHECK(status(-1) == Status::frame_expired);
  CHECK(status(4.001) == Status::bad_number);
  CHECK(status(std::numeric_limits<double>::infinity()) == Status::bad_number);
  CHECK(status(std::numeric_limits<double>::quiet_NaN()) == Status::bad_number);
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
      if (pose.position.x > side) pose.position.x -= 4;
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
    const auto at = [&] { return static_cast<double>(random() % 1000) * side / 1000; };
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
      if (draw == 1) REQUIRE(world.set_enabled(id, random() % 2 == 0) == Status::ok);
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
std::vector<ObjectView> between(const std::vector<ObjectView>& earlier, const std::vector<ObjectView>& later,
                                const std::set<ObjectNumber>& placed, std::uint64_t later_frame, double fraction) {
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

TEST_CASE("between two frames objects are on their way, except for those that jump, change their shape or are absent") {
  WorldConfig base = world_with_history(3);
  base.motion = std::make_shared<JumpingModel>();
  in_all_worlds(base, {0u, 3u}, [](const WorldConfig& config) {
    ChangingWorld changing(config, 17);
    World& world = changing.world;
    changing.run_frame();
    std::vector<ObjectView> earlier = world.objects();
    std::size_t found = 0;
    for (int round = 0; round < 12; ++round) {
      changing.run_frame();
      const Snapshot snapshot = world.snapshot();
      const std::vector<ObjectView> later = world.objects();
      const Queries queries = make_queries(world, changing.shapes, side, 12, static_cast<unsigned>(round));
      for (const double fraction : {0.5, 0.0625, 0.9999}) {
        const double frame = static_cast<double>(snapshot.frame()) - 1 + fraction;
        const Answers answers = answer(snapshot, about(queries, frame));
        // The fraction as the snapshot computes it.
        const double share = frame - std::floor(frame);
        const AllObjects oracle(world, between(earlier, later, changing.placed, snapshot.frame(), share));
        CHECK((answers == oracle.answer(queries)));
        for (const Hit& hit : answers.hits) found += hit ? 1 : 0;
      }
      earlier = later;
    }
    CHECK(found > 200);
  });
}

}  // namespace
}  // namespace ringfence::test
