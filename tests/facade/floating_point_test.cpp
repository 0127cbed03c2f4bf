// The caller's floating-point environment: not used by a World, and as it was after each call.
#include <atomic>
#include <cstdint>
#include <functional>
#include <limits>
#include <memory>
#include <stdexcept>
#include <string>
#include <vector>

#include <doctest/doctest.h>

#include "base/caller_environment.hpp"
#include "facade/bouncing_world.hpp"
#include "geometry/ellipsoid.hpp"
#include "ringfence/error.hpp"
#include "ringfence/world.hpp"

namespace ringfence::test {
namespace {

/// Notes every environment other than the default in which the embedder's code is called.
struct Witness {
  std::uint64_t usual = floating_point_modes();
  std::atomic<std::uint64_t> calls{0}, others{0};
  void see() {
    ++calls;
    others += floating_point_modes() == usual ? 0 : 1;
  }
};

class WatchedModel : public BouncingModel {
 public:
  WatchedModel(double side, Witness& witness) : BouncingModel(side), witness_(witness) {}
  void start(const ObjectSpec& spec, std::byte* state) const override {
    witness_.see();
    BouncingModel::start(spec, state);
  }
  void move(std::uint64_t frame, std::span<const MotionInput> inputs, std::span<MotionOutput> outputs) const override {
    witness_.see();
    BouncingModel::move(frame, inputs, outputs);
  }

 private:
  Witness& witness_;
};

class WatchedShape : public SupportFunction {
 public:
  explicit WatchedShape(Witness& witness) : witness_(witness) {}
  Vec3f support(Vec3f direction) const override {
    witness_.see();
    return Ellipsoid({0.6f, 0.7f, 0.8f}).support(direction);
  }

 private:
  Witness& witness_;
};

class Throwing : public SupportFunction {
 public:
  Vec3f support(Vec3f) const override { throw std::runtime_error("no such shape"); }
};

TEST_CASE("motion models and support functions run in the default environment, from every caller") {
  for (const Caller caller : callers) {
    for (const Deployment deployment : {Deployment::user, Deployment::user_server, Deployment::user_collision}) {
      for (const std::uint32_t nodes : {0u, 2u}) {
        CAPTURE(std::string(name_of(caller)));
        CAPTURE(name_of(deployment));
        CAPTURE(nodes);
        Witness model, shape;
        WorldConfig config;
        config.bounds_max = {6, 6, 6};
        config.deployment = deployment;
        config.nodes = nodes;
        config.motion = std::make_shared<WatchedModel>(6, model);
        const auto world = call_from(caller, [&] { return std::make_unique<World>(config); });
        populate(*world, 30, 3, 6, caller);
        const ShapeDescription ellipsoid = SupportShape{std::make_shared<WatchedShape>(shape)};
        ObjectSpec spec;
        spec.shape = call_from(caller, [&] { return world->add_shape(ellipsoid); });
        spec.pose.position = {3, 3, 3};
        for (int frame = 0; frame < 6; ++frame) {
          REQUIRE(call_from(caller, [&] { return world->spawn(spec); }).status == Status::ok);
          // More nodes are more threads, made from within a call.
          if (frame == 3 && nodes > 0) REQUIRE(call_from(caller, [&] { return world->resize(4); }) == Status::ok);
          REQUIRE(call_from(caller, [&] { return world->advance(); }) == Status::ok);
        }
        CHECK(model.calls > 20);
        CHECK(model.others == 0);
        CHECK(shape.calls > 500);
        CHECK(shape.others == 0);
      }
    }
  }
}

TEST_CASE("the caller's environment is as it was after each call, whether it returns or throws") {
  for (const Caller caller : callers) {
    for (const std::uint32_t nodes : {0u, 2u}) {
      CAPTURE(std::string(name_of(caller)));
      CAPTURE(nodes);
      const CallerEnvironment environment(caller);
      const std::uint64_t before = floating_point_modes();
      const auto unchanged = [&](const char* what, const std::function<void()>& call) {
        CAPTURE(what);
        call();
        CHECK(floating_point_modes() == before);
      };
      WorldConfig config;
      config.bounds_max = {10, 10, 10};
      config.nodes = nodes;
      config.motion = std::make_shared<BouncingModel>(10);
      WorldConfig bad = config;
      bad.bounds_min = {0, 0, std::numeric_limits<double>::quiet_NaN()};
      unchanged("a constructor that throws", [&] { CHECK_THROWS_AS(World{bad}, Error); });
      std::unique_ptr<World> world;
      unchanged("constructor", [&] { world = std::make_unique<World>(config); });
      ObjectSpec spec;
      unchanged("add_shape", [&] { spec.shape = world->add_shape(Sphere{1}); });
      unchanged("add_shape of a mesh", [&] {
        world->add_shape(TriangleMesh{{{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0, 0, 1}}, {0, 1, 2, 0, 1, 3}});
      });
      unchanged("add_shape that throws", [&] { CHECK_THROWS_AS(world->add_shape(Sphere{-1}), Error); });
      unchanged("add_shape of a function that throws",
                [&] { CHECK_THROWS_AS(world->add_shape(SupportShape{std::make_shared<Throwing>()}), Error); });
      UserId user = no_user;
      unchanged("connect", [&] { user = world->connect().user; });
      ObjectId object, avatar;
      unchanged("spawn", [&] { object = world->spawn(spec).id; });
      spec.category = Category::avatar;
      spec.user = user;
      unchanged("spawn", [&] { avatar = world->spawn(spec).id; });
      spec.pose.orientation.w = std::numeric_limits<float>::quiet_NaN();
      unchanged("spawn that is refused", [&] { CHECK(world->spawn(spec).status == Status::not_finite); });
      const Pose pose{{1, 1, 1}, {0.6f, 0, 0, 0.8f}};
      for (int frame = 0; frame < 3; ++frame) {
        unchanged("place", [&] { CHECK(world->place(object, pose) == Status::ok); });
        unchanged("move", [&] { CHECK(world->move(user, avatar, pose) == Status::ok); });
        unchanged("begin_frame", [&] { CHECK(world->begin_frame() == Status::ok); });
        unchanged("add_shape within a frame", [&] { CHECK_THROWS_AS(world->add_shape(Sphere{1}), Error); });
        unchanged("finish_frame", [&] { CHECK(world->finish_frame() == Status::ok); });
        unchanged("results", [&] {
          CHECK(world->contacts().size() == world->collisions_of(object).size());
          CHECK(world->objects().size() == 2);
        });
      }
      unchanged("resize", [&] { CHECK(world->resize(1 + nodes) == Status::ok); });
      unchanged("advance", [&] { CHECK(world->advance() == Status::ok); });
      unchanged("inject", [&] {
        CHECK(world->inject({.node = NodeId(0), .frame = 1000}) == (nodes == 0 ? Status::bad_number : Status::ok));
      });
      unchanged("set_enabled", [&] { CHECK(world->set_enabled(object, false) == Status::ok); });
      unchanged("destroy", [&] { CHECK(world->destroy(object) == Status::ok); });
      unchanged("disconnect", [&] { CHECK(world->disconnect(user) == Status::ok); });
      unchanged("begin_frame", [&] { CHECK(world->begin_frame() == Status::ok); });
      unchanged("a destructor within a frame", [&] { world.reset(); });
    }
  }
}

}  // namespace
}  // namespace ringfence::test
