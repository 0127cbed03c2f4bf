// Queries of motion models about the frame before.
#include <limits>
#include <map>
#include <memory>
#include <optional>
#include <utility>
#include <vector>

#include <doctest/doctest.h>

#include "facade/checks.hpp"
#include "facade/queries/senses_check.hpp"
#include "facade/script.hpp"
#include "geometry/ellipsoid.hpp"
#include "ringfence/save.hpp"
#include "ringfence/world.hpp"

namespace ringfence::test {
namespace {

constexpr double side = 16;
constexpr double sense = 5;

WorldConfig small_world() {
  WorldConfig config;
  config.bounds_max = {side, side, side};
  config.interest = 4;
  config.sense = sense;
  config.layers.names = {"solid", "ghost"};
  config.layers.collide = {{0, 0}};
  return config;
}

/// A mesh in the middle, which all models can sense.
TriangleMesh walls() {
  return {{{-3, 0, -2}, {3, 0, -2}, {3, 0, 2}, {-3, 0, 2}, {0, -3, -2}, {0, 3, -2}, {0, 3, 2}, {0, -3, 2}},
          {0, 1, 2, 0, 2, 3, 4, 5, 6, 4, 6, 7}};
}

/// A world whose objects sense, and what they must find.
class SensingWorld {
 public:
  SensingWorld(WorldConfig config, unsigned seed) : model_(std::make_shared<SensingModel>(side, sense)), check(sense) {
    config.motion = model_;
    world.emplace(config);
    script.emplace(*world, seed, side);
    const ShapeId mesh = world->add_shape(walls());
    REQUIRE(world->spawn({.shape = mesh, .category = Category::fixed, .pose = {{8, 8, 8}, {}}}).status == Status::ok);
  }

  /// Runs a frame with the script's requests, and checks what was asked.
  void run() {
    script->make_requests();
    run_alone();
  }
  /// The same without requests.
  void run_alone() {
    before_.emplace(world->frames(), *world);
    REQUIRE(world->advance() == Status::ok);
    check_all();
  }
  /// Ends the world, and checks what threads asked that it had to wait for.
  void end() {
    world.reset();
    check_all();
  }

 private:
  // If a role is lost, an object may ask several times in a frame, also after the frame has ended.
  void check_all() {
    for (SensedByObject& sensed : model_->take()) {
      CAPTURE(sensed.frame);
      CAPTURE(sensed.self.number());
      const auto [known, is_new] = known_.try_emplace({sensed.frame, sensed.self}, sensed);
      if (!is_new) {
        ++repeated;
        CHECK(known->second == sensed);
      } else if (sensed.frame == 0) {
        CHECK(sensed.cast.status == Status::out_of_order);
        CHECK(sensed.overlap_status == Status::out_of_order);
      } else {
        after_their_frame += before_.rbegin()->first != sensed.frame || !world ? 1 : 0;
        check.check(sensed, before_.at(sensed.frame));
      }
    }
  }

  std::shared_ptr<SensingModel> model_;
  std::map<std::pair<std::uint64_t, ObjectId>, SensedByObject> known_;
  std::map<std::uint64_t, AllObjects> before_;  ///< by frame: all objects of the frame before it

 public:
  SensesCheck check;
  std::optional<World> world;
  std::optional<Script> script;
  std::size_t repeated = 0, after_their_frame = 0;
};

TEST_CASE("objects sense what a test of every object of the frame before finds, and move the same in each deployment") {
  std::optional<std::uint64_t> first;
  in_all_worlds(small_world(), {0u, 1u, 3u}, [&](WorldConfig config) {
    config.history = config.nodes;  // neither a history nor snapshots change what is sensed
    SensingWorld world(config, 11);
    for (int frame = 0; frame < 14; ++frame) {
      CAPTURE(frame);
      if (frame % 4 == 3) {
        REQUIRE(world.world->resize(config.nodes == 0 ? 2 : static_cast<std::uint32_t>(1 + frame / 4)) == Status::ok);
      }
      if (frame % 5 == 1) CHECK(world.world->snapshot().frame() + 1 == world.world->frames());
      world.run();
      require_counts(*world.world);
      require_nothing_refused(*world.world);
    }
    CHECK(world.check.answered > 1000);
    CHECK(world.check.refused > 200);
    CHECK(world.check.found > 200);
    CHECK(world.repeated == 0);
    const std::uint64_t print = fingerprint(*world.world);
    if (!first) first = print;
    CHECK(print == *first);
  });
}

TEST_CASE("frames in which CD nodes are lost have the same answers and the same states") {
  for (const Deployment deployment : {Deployment::user_server, Deployment::user_collision}) {
    for (const Placement placement : {Placement::server, Placement::region}) {
      std::optional<std::uint64_t> print;
      for (const bool lose : {false, true}) {
        WorldConfig config = small_world();
        config.deployment = deployment;
        config.placement = placement;
        config.nodes = 6;
        if (lose) config.deadlines.node_ms = 200;
        CAPTURE(describe(config));
        SensingWorld world(config, 3);
        world.run();
        std::size_t lost = 0;
        for (unsigned frame = 1; lose && frame <= 12; ++frame) {
          if (frame % 2 == 1) {
            // The node that is named may have been lost already.
            (void)world.world->inject({.node = NodeId(frame / 2),
                                       .frame = frame,
                                       .stage = static_cast<NodeStage>(frame / 2),
                                       .stall_ms = frame % 4 == 1 ? 500.0 : 0});
          }
          world.run();
          lost += world.world->report().lost.size();
        }
        for (unsigned frame = 1; !lose && frame <= 12; ++frame) world.run();
        CHECK((!lose || lost >= 4));
        if (!print) print = fingerprint(*world.world);
        CHECK(fingerprint(*world.world) == *print);
        world.world->release_faults();
      }
    }
  }
}

TEST_CASE("a user node that stops in its model is late, and what it asks later is still about its own frame") {
  for (const Deployment deployment : {Deployment::user, Deployment::user_collision}) {
    WorldConfig config = small_world();
    config.deployment = deployment;
    config.nodes = 2;
    config.user_threads = 2;
    config.deadlines.user_ms = 300;
    CAPTURE(describe(config));
    SensingWorld world(config, 5);
    world.run();
    const ShapeId ball(0);
    std::vector<UserId> users;
    for (int i = 0; i < 3; ++i) users.push_back(world.world->connect().user);
    for (int i = 0; i < 24; ++i) {
      const UserId user = users[static_cast<std::size_t>(i % 3)];
      REQUIRE(
          world.world->spawn({.shape = ball, .category = Category::avatar, .user = user, .pose = {{i * 0.6, 7, 8}, {}}})
              .status == Status::ok);
    }
    std::size_t late = 0;
    for (unsigned frame = 1; frame < 10; ++frame) {
      CAPTURE(frame);
      if (frame % 3 == 2) {
        REQUIRE(world.world->inject(
                    {.node = {}, .frame = frame, .stage = NodeStage::model, .user = users[frame / 3 % 3]}) ==
                Status::ok);
      }
      world.run_alone();
      late += world.world->report().late.size();
    }
    CHECK(late >= 3);
    world.world->release_faults();
    world.end();
    CHECK(world.after_their_frame > 0);
  }
}

TEST_CASE("a restored world senses the last frame of the saved one") {
  WorldConfig config = small_world();
  std::optional<World> restored;
  std::optional<SensingWorld> saved;
  saved.emplace(config, 13);
  for (int frame = 0; frame < 4; ++frame) saved->run();
  MemorySink sink;
  REQUIRE(saved->world->save(sink) == Status::ok);
  for (const std::uint32_t nodes : {0u, 3u}) {
    config.nodes = nodes;
    config.motion = std::make_shared<SensingModel>(side, sense, false);
    config.support_functions = {std::make_shared<Ellipsoid>(Vec3f{0.5f, 0.7f, 0.9f})};
    MemorySource source(sink.bytes());
    restored.emplace(config, source);
    for (int frame = 0; frame < 3; ++frame) {
      if (nodes == 0) saved->run_alone();
      REQUIRE(restored->advance() == Status::ok);
    }
    CHECK(fingerprint(*restored) == fingerprint(*saved->world));
  }
}

/// Asks the same query in each frame.
class AskingModel final : public MotionModel {
 public:
  void move(std::uint64_t, std::span<const MotionInput> inputs, std::span<MotionOutput>) const override {
    for (const MotionInput& in : inputs) {
      had_senses = in.senses != nullptr;
      if (!had_senses) continue;
      const Vec3d& at = in.pose.position;
      hits = {in.senses->cast({at, {4, 0, 0}, {.except = in.senses->self()}}),
              in.senses->cast({at, {4.5, 0, 0}, {.except = in.senses->self()}}),
              in.senses->nearest({at, 1e300}),
              in.senses->nearest({at, -1}),
              in.senses->sweep({ShapeId(99), {at, {}}, {1, 0, 0}}),
              in.senses->cast({at, {4, 0, 0}, {.except = in.senses->self()}, 1.0}),
              in.senses->cast({{at.x, at.y, std::numeric_limits<double>::quiet_NaN()}, {1, 0, 0}})};
    }
  }
  mutable std::vector<Hit> hits;
  mutable bool had_senses = false;
};

TEST_CASE("a query that reaches too far, is about another frame or is not valid is refused, and says so") {
  WorldConfig config;
  config.nodes = 0;
  config.sense = 4;
  const auto model = std::make_shared<AskingModel>();
  config.motion = model;
  World world(config);
  const ShapeId ball = world.add_shape(Sphere{1});
  REQUIRE(world.spawn({.shape = ball, .pose = {{10, 10, 10}, {}}}).status == Status::ok);
  const ObjectId target = world.spawn({.shape = ball, .category = Category::fixed, .pose = {{13, 10, 10}, {}}}).id;
  REQUIRE(world.advance() == Status::ok);
  for (const Hit& hit : model->hits) CHECK(hit.status == Status::out_of_order);
  for (int frame = 0; frame < 2; ++frame) {
    REQUIRE(world.advance() == Status::ok);
    REQUIRE(model->hits.size() == 7);
    CHECK(model->hits[0].status == Status::ok);
    CHECK(model->hits[0].object == target);
    CHECK(model->hits[0].fraction == doctest::Approx(0.5));
    CHECK(model->hits[1].status == Status::beyond_sense);
    CHECK(!model->hits[1]);
    CHECK(model->hits[2].status == Status::beyond_sense);
    CHECK(model->hits[3].status == Status::bad_number);
    CHECK(model->hits[4].status == Status::unknown_shape);
    CHECK(model->hits[5].status == (frame == 1 ? Status::ok : Status::frame_expired));
    CHECK(model->hits[6].status == Status::not_finite);
  }
}

TEST_CASE("without a distance models have no senses, and a distance must be a number") {
  const auto model = std::make_shared<AskingModel>();
  model->had_senses = true;
  WorldConfig config;
  config.motion = model;
  World world(config);
  const ShapeId ball = world.add_shape(Sphere{1});
  REQUIRE(world.spawn({.shape = ball, .pose = {{10, 10, 10}, {}}}).status == Status::ok);
  for (int frame = 0; frame < 2; ++frame) REQUIRE(world.advance() == Status::ok);
  CHECK(!model->had_senses);
  for (const double wrong : {-1.0, std::numeric_limits<double>::infinity(), std::numeric_limits<double>::quiet_NaN()}) {
    config.sense = wrong;
    CHECK_THROWS_WITH_AS(World{config}, doctest::Contains("sense is"), Error);
  }
}

}  // namespace
}  // namespace ringfence::test
