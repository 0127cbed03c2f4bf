// An invalid call is refused with a status, is counted by reason in the next report, and has no effect.
#include <cmath>
#include <limits>
#include <string>
#include <vector>

#include <doctest/doctest.h>

#include "facade/checks.hpp"
#include "facade/script.hpp"
#include "ringfence/world.hpp"

namespace ringfence::test {
namespace {

/// Two users with an avatar each, one active, one static and one destroyed object.
struct Scene {
  explicit Scene(const WorldConfig& config) : world(config) {
    ball = world.add_shape(Sphere{1});
    alice = world.connect().user;
    bob = world.connect().user;
    avatar = world.spawn({.shape = ball, .category = Category::avatar, .user = alice, .pose = at(10)}).id;
    other = world.spawn({.shape = ball, .category = Category::avatar, .user = bob, .pose = at(11)}).id;
    active = world.spawn({.shape = ball, .pose = at(30)}).id;
    fixed = world.spawn({.shape = ball, .category = Category::fixed, .pose = at(31)}).id;
    gone = world.spawn({.number = 77, .shape = ball, .pose = at(50)}).id;
    advance(world);
    REQUIRE(world.destroy(gone) == Status::ok);
    advance(world);
    REQUIRE(world.contacts().size() == 2);
  }
  static Pose at(double x) { return {{x, 50, 50}, {}}; }
  World world;
  ShapeId ball;
  UserId alice, bob;
  ObjectId avatar, other, active, fixed, gone;
};

/// Makes refused calls, then runs a frame: the report counts `times` refusals of that reason and no others, and the
/// world is unchanged.
template <class Call>
void expect(Scene& scene, Status reason, std::uint64_t times, Call call) {
  const std::uint64_t before = fingerprint(scene.world);
  call();
  REQUIRE(scene.world.advance() == Status::ok);
  require_counts(scene.world);
  for (std::size_t r = 0; r < status_count; ++r) {
    CAPTURE(name_of(static_cast<Status>(r)));
    CHECK(scene.world.report().refused[r] == (r == static_cast<std::size_t>(reason) ? times : 0));
  }
  CHECK(fingerprint(scene.world) == before);
  advance(scene.world);  // the refusals are not counted again
}

TEST_CASE("every refused call returns its reason, is counted in the next report, and changes nothing") {
  WorldConfig config;
  config.layers.names = {"solid", "ghost"};
  config.layers.collide = {{0, 0}, {0, 1}};
  config.capacities.users = config.limits.users = 4;
  config.quotas.avatars = 1;
  const double nan = std::numeric_limits<double>::quiet_NaN();
  const double inf = std::numeric_limits<double>::infinity();
  in_all_worlds(config, {0u, 2u}, [&](const WorldConfig& other_config) {
    Scene s(other_config);
    World& w = s.world;
    advance(w);  // now all contacts persist
    const Pose ok = Scene::at(20);
    const Pose bad_position{{0, nan, 0}, {}}, bad_infinity{{-inf, 0, 0}, {}}, bad_turn{{0, 0, 0}, {0, 0, 0, 0}},
        bad_long{{0, 0, 0}, {0.1f, 0, 0, 1}}, bad_quat{{0, 0, 0}, {static_cast<float>(nan), 0, 0, 1}};

    expect(s, Status::over_quota, 1, [&] {
      CHECK(w.spawn({.shape = s.ball, .category = Category::avatar, .user = s.alice, .pose = ok}).status ==
            Status::over_quota);
    });
    expect(s, Status::stale_object, 9, [&] {
      CHECK(w.destroy(s.gone) == Status::stale_object);
      CHECK(w.destroy(s.alice, s.gone) == Status::stale_object);
      CHECK(w.move(s.alice, s.gone, ok) == Status::stale_object);
      CHECK(w.place(s.gone, ok) == Status::stale_object);
      CHECK(w.set_enabled(s.gone, true) == Status::stale_object);
      CHECK(w.destroy(ObjectId{}) == Status::stale_object);
      CHECK(w.place(ObjectId{}, ok) == Status::stale_object);
      // Right number, wrong generation; right generation, wrong number.
      CHECK(w.place(ObjectId::of(s.active.number(), s.active.generation() + 1), ok) == Status::stale_object);
      CHECK(w.move(s.alice, ObjectId::of(s.avatar.number() + 1000, s.avatar.generation()), ok) == Status::stale_object);
    });
    expect(s, Status::not_host, 6, [&] {
      CHECK(w.move(s.alice, s.other, ok) == Status::not_host);
      CHECK(w.move(s.bob, s.avatar, ok) == Status::not_host);
      CHECK(w.move(s.alice, s.active, ok) == Status::not_host);
      CHECK(w.move(s.alice, s.fixed, ok) == Status::not_host);
      CHECK(w.destroy(s.alice, s.other) == Status::not_host);
      CHECK(w.destroy(s.alice, s.active) == Status::not_host);
    });
    expect(s, Status::not_finite, 7, [&] {
      CHECK(w.move(s.alice, s.avatar, bad_position) == Status::not_finite);
      CHECK(w.move(s.alice, s.avatar, bad_quat) == Status::not_finite);
      CHECK(w.place(s.active, bad_infinity) == Status::not_finite);
      CHECK(w.place(s.avatar, bad_quat) == Status::not_finite);
      CHECK(w.spawn({.shape = s.ball, .pose = bad_position}).status == Status::not_finite);
      CHECK(w.spawn({.shape = s.ball, .pose = bad_infinity}).status == Status::not_finite);
      CHECK_FALSE(w.spawn({.shape = s.ball, .pose = bad_quat}).id);
    });
    expect(s, Status::not_unit, 4, [&] {
      CHECK(w.move(s.alice, s.avatar, bad_turn) == Status::not_unit);
      CHECK(w.place(s.active, bad_long) == Status::not_unit);
      CHECK(w.spawn({.shape = s.ball, .pose = bad_turn}).status == Status::not_unit);
      CHECK(w.spawn({.shape = s.ball, .pose = bad_long}).status == Status::not_unit);
    });
    expect(s, Status::unknown_user, 7, [&] {
      CHECK(w.move(UserId(3), s.avatar, ok) == Status::unknown_user);
      CHECK(w.move(no_user, s.avatar, ok) == Status::unknown_user);
      CHECK(w.destroy(UserId(3), s.avatar) == Status::unknown_user);
      CHECK(w.destroy(no_user, s.active) == Status::unknown_user);
      CHECK(w.disconnect(UserId(3)) == Status::unknown_user);
      CHECK(w.disconnect(no_user) == Status::unknown_user);
      CHECK(w.spawn({.shape = s.ball, .category = Category::avatar, .user = UserId(3)}).status == Status::unknown_user);
    });
    expect(s, Status::unknown_shape, 2, [&] {
      CHECK(w.spawn({.shape = ShapeId(s.ball.number() + 1)}).status == Status::unknown_shape);
      CHECK(w.spawn({.shape = ShapeId(0xffffffffu)}).status == Status::unknown_shape);
    });
    expect(s, Status::unknown_layer, 2, [&] {
      CHECK(w.spawn({.shape = s.ball, .layer = 2}).status == Status::unknown_layer);
      CHECK(w.spawn({.shape = s.ball, .layer = 255}).status == Status::unknown_layer);
    });
    expect(s, Status::number_in_use, 4, [&] {
      CHECK(w.spawn({.number = s.avatar.number(), .shape = s.ball}).status == Status::number_in_use);
      CHECK(w.spawn({.number = s.fixed.number(), .shape = s.ball}).status == Status::number_in_use);
      CHECK(w.connect(s.alice).status == Status::number_in_use);
      CHECK(w.connect(s.bob).user == no_user);
    });
    expect(s, Status::bad_category, 6, [&] {
      CHECK(w.place(s.fixed, ok) == Status::bad_category);
      CHECK(w.set_enabled(s.fixed, false) == Status::bad_category);
      CHECK(w.spawn({.shape = s.ball, .category = Category::avatar}).status == Status::bad_category);
      CHECK(w.spawn({.shape = s.ball, .category = Category::active, .user = s.alice}).status == Status::bad_category);
      CHECK(w.spawn({.shape = s.ball, .category = Category::fixed, .user = s.alice}).status == Status::bad_category);
      CHECK(w.spawn({.shape = s.ball, .category = static_cast<Category>(9)}).status == Status::bad_category);
    });
    expect(s, Status::over_capacity, 2, [&] {
      CHECK(w.connect(UserId(4)).status == Status::over_capacity);
      CHECK(w.connect(UserId(0x7fffffffu)).status == Status::over_capacity);
    });
    expect(s, Status::out_of_order, 1, [&] { CHECK(w.finish_frame() == Status::out_of_order); });

    // Between begin and finish, calls that need an idle World are refused and counted in that frame's report.
    REQUIRE(w.begin_frame() == Status::ok);
    CHECK(w.begin_frame() == Status::out_of_order);
    CHECK(w.advance() == Status::out_of_order);
    CHECK_THROWS_WITH_AS(w.add_shape(Sphere{1}), doctest::Contains("begin_frame"), Error);
    CHECK_FALSE(w.object(s.avatar).id);
    CHECK(w.objects().empty());
    REQUIRE(w.finish_frame() == Status::ok);
    CHECK(refused(w, Status::out_of_order) == 2);
  });
}

TEST_CASE("an object number is in use until the frame that ends its object is complete") {
  World world({});
  const ShapeId ball = world.add_shape(Sphere{1});
  const ObjectId first = world.spawn({.number = 5, .shape = ball}).id;
  advance(world);
  CHECK(world.destroy(first) == Status::ok);
  CHECK(world.destroy(first) == Status::stale_object);
  CHECK(world.spawn({.number = 5, .shape = ball}).status == Status::number_in_use);
  REQUIRE(world.begin_frame() == Status::ok);
  CHECK(world.spawn({.number = 5, .shape = ball}).status == Status::number_in_use);
  REQUIRE(world.finish_frame() == Status::ok);
  const ObjectId second = world.spawn({.number = 5, .shape = ball}).id;
  CHECK(second);
  CHECK(second != first);
  CHECK(world.find(5) == second);
  advance(world);
  CHECK(world.place(first, {}) == Status::stale_object);  // the old id does not refer to the new object
  CHECK_FALSE(world.object(first).id);
  CHECK(world.object(second).id == second);
}

TEST_CASE("a user number is in use until the frame that disconnects its user node is complete") {
  in_all_worlds({}, {0u, 1u}, [&](const WorldConfig& config) {
    World world(config);
    CHECK(world.connect(UserId(3)).user == UserId(3));
    CHECK(world.connect().user == UserId(0));
    advance(world);
    CHECK(world.disconnect(UserId(3)) == Status::ok);
    CHECK(world.disconnect(UserId(3)) == Status::unknown_user);
    CHECK(world.connect(UserId(3)).status == Status::number_in_use);
    REQUIRE(world.begin_frame() == Status::ok);
    CHECK(world.connect(UserId(3)).status == Status::number_in_use);
    CHECK(world.connect().user == UserId(1));
    REQUIRE(world.finish_frame() == Status::ok);
    CHECK(world.connect(UserId(3)).status == Status::ok);
    // A user can connect and disconnect without a frame in between.
    CHECK(world.connect(UserId(9)).status == Status::ok);
    CHECK(world.disconnect(UserId(9)) == Status::ok);
    advance(world);
    CHECK(world.connect(UserId(9)).status == Status::ok);
    advance(world);
  });
}

TEST_CASE("objects beyond the configured limit are refused, and there is room again when others have ended") {
  WorldConfig config;
  config.capacities.objects = 2;
  config.limits.objects = 3;
  World world(config);
  const ShapeId ball = world.add_shape(Sphere{1});
  std::vector<ObjectId> ids;
  for (int i = 0; i < 3; ++i) ids.push_back(world.spawn({.shape = ball}).id);
  CHECK(world.spawn({.shape = ball}).status == Status::over_capacity);
  REQUIRE(world.advance() == Status::ok);
  CHECK(refused(world, Status::over_capacity) == 1);
  CHECK(world.report().objects == 3);
  CHECK(world.contacts().size() == 3);
  CHECK(world.destroy(ids[1]) == Status::ok);
  advance(world);
  CHECK(world.spawn({.shape = ball}).status == Status::ok);
  advance(world);
  CHECK(world.report().objects == 3);
}

TEST_CASE("an invalid configuration is refused with the name of the field and its valid values") {
  const auto throws = [](const char* field, auto change) {
    WorldConfig config;
    change(config);
    CAPTURE(field);
    CHECK_THROWS_WITH_AS(World{config}, doctest::Contains(field), Error);
  };
  const double nan = std::numeric_limits<double>::quiet_NaN();
  throws("bounds", [](WorldConfig& c) { c.bounds_max.x = -1; });
  throws("bounds", [&](WorldConfig& c) { c.bounds_min.y = nan; });
  throws("bounds", [](WorldConfig& c) { c.bounds_max.z = std::numeric_limits<double>::infinity(); });
  throws("nodes", [](WorldConfig& c) { c.nodes = 1025; });
  throws("nodes", [](WorldConfig& c) {
    c.tuning.cells_log2[0] = 1;
    c.nodes = 3;
  });
  throws("user_threads", [](WorldConfig& c) { c.user_threads = 0; });
  throws("user_threads", [](WorldConfig& c) { c.user_threads = 257; });
  throws("cells_log2", [](WorldConfig& c) { c.tuning.cells_log2[1] = 11; });
  throws("interest", [](WorldConfig& c) { c.interest = -1; });
  throws("interest", [&](WorldConfig& c) { c.interest = nan; });
  throws("capacities.objects", [](WorldConfig& c) { c.capacities.objects = 0; });
  throws("capacities.users", [](WorldConfig& c) { c.capacities.users = c.limits.users + 1; });
  throws("ring_bytes", [](WorldConfig& c) { c.tuning.ring_bytes = 5000; });
  throws("ring_bytes", [](WorldConfig& c) { c.tuning.ring_bytes = 2048; });
  throws("layers", [](WorldConfig& c) { c.layers.names.resize(33, "x"); });
  throws("layers", [](WorldConfig& c) { c.layers.collide = {{0, 0}}; });
  throws("layers", [](WorldConfig& c) {
    c.layers.names = {"one"};
    c.layers.collide = {{0, 1}};
  });
  class OversizedStateModel : public MotionModel {
    std::size_t state_bytes() const noexcept override { return max_motion_state + 1; }
    void move(std::uint64_t, std::span<const MotionInput>, std::span<MotionOutput>) const override {}
  };
  throws("motion", [](WorldConfig& c) { c.motion = std::make_shared<OversizedStateModel>(); });
}

TEST_CASE("an invalid shape is refused with a reason, and earlier shapes stay registered") {
  World world({});
  const ShapeId ball = world.add_shape(Sphere{1});
  const ShapeDescription bad[] = {
      Sphere{0},   Sphere{-1}, Box{{1, 0, 1}}, Capsule{0, 1}, ConvexHull{{{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {1, 1, 0}}},
      ConvexHull{}};
  for (const ShapeDescription& shape : bad) {
    CHECK_THROWS_AS(world.add_shape(shape), Error);
  }
  CHECK(world.shape_count() == 1);
  CHECK(std::get<Sphere>(world.shape(ball)).radius == 1);
  CHECK(world.add_shape(Box{{1, 1, 1}}) == ShapeId(1));
}

}  // namespace
}  // namespace ringfence::test
