#include "motion/steering.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include <doctest/doctest.h>

#include "motion/ball_world.hpp"
#include "motion/random.hpp"
#include "ringfence/error.hpp"

namespace ringfence::motion {
namespace {

/// The configuration for a world in which `objects` balls of radius 1 m fill 6 % of the volume.
SteeringConfig config_for(std::uint32_t objects, std::uint64_t seed = 1) {
  SteeringConfig config;
  const double side = std::cbrt(objects * 4.18879 / 0.06);
  config.bounds_max = {side, side, side};
  config.targets = objects / 50;
  config.seed = seed;
  return config;
}

/// Adds `objects` balls, alternately non-active and active. The active ones start near their goals.
test::BallWorld filled_world(const Steering& model, std::uint32_t objects, std::uint64_t seed) {
  const double side = model.config().bounds_max.x;
  test::BallWorld world(model);
  for (std::uint32_t number = 1; number <= objects; ++number) {
    Draws draws(seed, 99, number);
    const double x = double{draws.unit()}, y = double{draws.unit()}, z = double{draws.unit()};
    if (number % 2 == 0) {
      const Vec3d goal = model.goal_of(number, 0);
      const auto near = [side](double at, double draw) { return std::clamp(at + 20 * draw - 10, 0.0, side); };
      world.add(number, Category::active, {near(goal.x, x), near(goal.y, y), near(goal.z, z)});
    } else {
      world.add(number, Category::non_active, {side * x, side * y, side * z});
    }
  }
  return world;
}

}  // namespace

TEST_CASE("motion does not depend on batch size or order, nor on the instance") {
  const std::uint64_t seed = 11;
  CAPTURE(seed);
  const Steering one(config_for(500, seed)), other(config_for(500, seed));
  test::BallWorld p = filled_world(one, 500, seed), q = filled_world(other, 500, seed);
  for (int frame = 0; frame < 120; ++frame) {
    p.advance(64);
    q.advance(7, true);
  }
  REQUIRE(!p.contacts().empty());
  for (std::size_t i = 0; i < p.objects().size(); ++i) {
    REQUIRE(p.objects()[i].pose == q.objects()[i].pose);
  }
}

TEST_CASE("another seed gives other positions") {
  const Steering one(config_for(100, 1)), other(config_for(100, 2));
  test::BallWorld p = filled_world(one, 100, 5), q = filled_world(other, 100, 5);
  for (int frame = 0; frame < 30; ++frame) {
    p.advance();
    q.advance();
  }
  std::size_t apart = 0;
  for (std::size_t i = 0; i < 100; ++i) apart += !(p.objects()[i].pose == q.objects()[i].pose);
  CHECK(apart >= 50);
}

TEST_CASE("4000 balls settle at 1600 to 3500 contacts a frame, at most 16 for each ball") {
  const Steering model(config_for(4000));
  test::BallWorld world = filled_world(model, 4000, 3);
  for (int frame = 0; frame < 180; ++frame) world.advance();  // all objects start together, so many meet at first
  double sum = 0;
  for (int frame = 0; frame < 80; ++frame) {
    world.advance();
    REQUIRE(world.contacts().size() >= 1600);
    REQUIRE(world.contacts().size() <= 3500);
    sum += static_cast<double>(world.contacts().size());
  }
  CHECK(sum / 80 > 1600);
  std::map<ObjectNumber, int> touching;
  for (const Contact& contact : world.contacts()) {
    ++touching[contact.a];
    ++touching[contact.b];
  }
  for (const auto& object : touching) CHECK_MESSAGE(object.second <= 16, "object ", object.first);
}

TEST_CASE("objects cluster around targets and disperse again") {
  const Steering model(config_for(1000));
  test::BallWorld world = filled_world(model, 1000, 3);
  const auto near_target = [&](std::uint32_t target) {
    const Vec3d target_position = model.target_position(target, world.frame());
    int near = 0;
    for (const ObjectSpec& object : world.objects()) {
      const Vec3d& p = object.pose.position;
      const double x = p.x - target_position.x, y = p.y - target_position.y, z = p.z - target_position.z;
      near += x * x + y * y + z * z < 36;
    }
    return near;
  };
  std::vector<int> smallest(20, 1000), largest(20, 0);
  for (int frame = 0; frame < 900; ++frame) {
    world.advance();
    if (frame % 20 != 0 || frame < 200) continue;
    for (std::uint32_t target = 0; target < 20; ++target) {
      smallest[target] = std::min(smallest[target], near_target(target));
      largest[target] = std::max(largest[target], near_target(target));
    }
  }
  int clustering_targets = 0;  // an even distribution has 13 objects within 6 m of a target
  for (std::size_t target = 0; target < 20; ++target)
    clustering_targets += smallest[target] <= 15 && largest[target] >= 30;
  CHECK(clustering_targets >= 10);
}

TEST_CASE("targets and objects stay within the bounds, and orientations stay normalised") {
  const SteeringConfig config = config_for(800);
  const Steering model(config);
  test::BallWorld world = filled_world(model, 800, 4);
  const double side = config.bounds_max.x;
  const auto inside = [&](const Vec3d& p) {
    return p.x >= 0 && p.y >= 0 && p.z >= 0 && p.x <= side && p.y <= side && p.z <= side;
  };
  for (int frame = 0; frame < 300; ++frame) {
    world.advance();
    for (std::uint32_t target = 0; target < config.targets; ++target) {
      REQUIRE(inside(model.target_position(target, world.frame())));
    }
    for (const ObjectSpec& object : world.objects()) {
      REQUIRE(inside(object.pose.position));
      const Quat& q = object.pose.orientation;
      REQUIRE(std::abs(q.x * q.x + q.y * q.y + q.z * q.z + q.w * q.w - 1) < 1e-5f);
    }
  }
}

TEST_CASE("a target keeps its position until its stated end, then moves elsewhere") {
  const Steering model(config_for(4000));
  for (std::uint32_t target = 0; target < 80; ++target) {
    const std::uint64_t end = model.target_end(target, 0);
    CHECK(model.target_position(target, 0) == model.target_position(target, end - 1));
    CHECK(!(model.target_position(target, 0) == model.target_position(target, end)));
  }
}

TEST_CASE("objects that steer rotate while they move") {
  const Steering model(config_for(100));
  test::BallWorld world = filled_world(model, 100, 8);
  for (int frame = 0; frame < 60; ++frame) world.advance();
  for (const ObjectSpec& object : world.objects()) {
    if (object.category == Category::active) CHECK(!(object.pose.orientation == Quat{}));
  }
}

TEST_CASE("a non-active object that nothing touches keeps its pose, bit for bit") {
  const Steering model(config_for(1000));
  test::BallWorld world(model);
  world.add(1, Category::non_active, {5, 5, 5});
  world.add(2, Category::fixed, {25, 5, 5});
  for (int frame = 0; frame < 100; ++frame) {
    world.advance();
    REQUIRE(world.moved() == 0);
  }
}

TEST_CASE("non-active objects that overlap push each other apart and come to rest exactly") {
  for (const double gap : {0.1, 0.5, 1.0, 1.5, 1.9}) {
    CAPTURE(gap);
    const Steering model(config_for(1000));
    test::BallWorld world(model);
    world.add(1, Category::non_active, {20, 20, 20});
    world.add(2, Category::non_active, {20 + gap, 20.1, 20});
    world.add(3, Category::non_active, {20, 20.4, 20 + gap});
    world.advance();  // finds the first contacts
    if (gap < 1.8) {
      world.advance();
      CHECK(world.moved() > 0);
    }
    for (int frame = 0; frame < 200; ++frame) world.advance();
    for (int frame = 0; frame < 50; ++frame) {
      world.advance();
      REQUIRE(world.moved() == 0);
    }
    for (const Contact& contact : world.contacts()) CHECK(contact.depth < model.config().slop + 0.01f);
  }
}

TEST_CASE("an active object pushes a non-active one out of its way") {
  const Steering model(config_for(1000));
  test::BallWorld world(model);
  const Vec3d start{20, 20, 20};
  world.add(2, Category::active, start);
  const Vec3d goal = model.goal_of(2, 0);
  const double x = goal.x - start.x, y = goal.y - start.y, z = goal.z - start.z;
  const double far = std::sqrt(x * x + y * y + z * z);
  REQUIRE(far > 3);
  const Vec3d obstacle{start.x + 2.2 * x / far, start.y + 2.2 * y / far, start.z + 2.2 * z / far + 0.2};
  world.add(3, Category::non_active, obstacle);
  for (int frame = 0; frame < 60; ++frame) world.advance();
  CHECK(!(world.objects()[1].pose.position == obstacle));
}

TEST_CASE("an invalid configuration is refused, and the message names the field") {
  SteeringConfig config;
  config.targets = 0;
  CHECK_THROWS_WITH_AS(Steering{config}, "steering: targets: expected 1 to 10000000", Error);
  config = {};
  config.bounds_max.y = std::numeric_limits<double>::quiet_NaN();
  CHECK_THROWS_AS(Steering{config}, Error);
  config = {};
  config.speed = 0;
  CHECK_THROWS_AS(Steering{config}, Error);
  config = {};
  config.retarget_interval = {5, 4};
  CHECK_THROWS_AS(Steering{config}, Error);
}

}  // namespace ringfence::motion
