#include <algorithm>
#include <cstdint>
#include <memory>
#include <random>
#include <set>
#include <utility>
#include <vector>

#include <doctest/doctest.h>

#include "facade/checks.hpp"
#include "ringfence/world.hpp"

using namespace ringfence;
using namespace ringfence::test;

namespace {

using Pairs = std::set<std::pair<ObjectNumber, ObjectNumber>>;

struct Ball {
  ObjectNumber number;
  UserId user;
  Vec3d at;
};

// Spheres with radius 1 at multiples of 1/8 m, so that the test is exact.
bool touch(const Ball& p, const Ball& q) {
  const double x = p.at.x - q.at.x, y = p.at.y - q.at.y, z = p.at.z - q.at.z;
  return x * x + y * y + z * z <= 4;
}

// Brute force: the rank of an avatar is the number of its user's avatars with
// lower numbers.
Pairs expected(const std::vector<Ball>& balls, std::size_t colliding) {
  const auto rank = [&](const Ball& ball) {
    return static_cast<std::size_t>(std::count_if(balls.begin(), balls.end(), [&](const Ball& other) {
      return other.user == ball.user && other.number < ball.number;
    }));
  };
  Pairs pairs;
  for (const Ball& p : balls) {
    for (const Ball& q : balls) {
      if (p.number >= q.number || !touch(p, q)) continue;
      const bool same = p.user != no_user && p.user == q.user;
      if (same && colliding != 0 && (rank(p) >= colliding || rank(q) >= colliding)) continue;
      pairs.insert({p.number, q.number});
    }
  }
  return pairs;
}

Pairs pairs_of(const World& world) {
  Pairs pairs;
  for (const Contact& contact : world.contacts()) pairs.insert({contact.a, contact.b});
  return pairs;
}

}  // namespace

TEST_CASE(
    "of a user's avatars only the lowest-numbered collide with each "
    "other, all with the objects of others") {
  for (const std::uint32_t nodes : {0u, 1u, 3u}) {
    for (const Placement placement : {Placement::server, Placement::region}) {
      for (const std::size_t colliding : {0u, 1u, 5u}) {
        CAPTURE(nodes);
        CAPTURE(colliding);
        WorldConfig config;
        config.nodes = nodes;
        config.placement = placement;
        config.bounds_max = {12, 12, 12};
        config.quotas.colliding_avatars = colliding;
        World world(config);
        const ShapeId shape = world.add_shape(Sphere{1});
        std::mt19937 random(11);
        const auto place = [&] {
          const auto eighth = [&] { return static_cast<double>(random() % 80) / 8; };
          const double x = eighth(), y = eighth(), z = eighth();
          return Vec3d{x, y, z};
        };
        std::vector<Ball> balls;
        std::vector<ObjectId> ids;
        const auto spawn = [&](UserId user) {
          const Vec3d at = place();
          const Category category = user == no_user ? Category::active : Category::avatar;
          const Spawned made = world.spawn({.shape = shape, .category = category, .user = user, .pose = {at, {}}});
          REQUIRE(made.status == Status::ok);
          balls.push_back({made.id.number(), user, at});
          ids.push_back(made.id);
        };
        std::vector<UserId> users;
        for (int i = 0; i < 20; ++i) users.push_back(world.connect().user);
        for (int i = 0; i < 60; ++i) spawn(no_user);
        for (int i = 0; i < 150; ++i) spawn(users[random() % users.size()]);
        for (int frame = 0; frame < 12; ++frame) {
          advance(world);
          REQUIRE(pairs_of(world) == expected(balls, colliding));
          // Some end, so that others move up; some appear, some move, and most
          // rest.
          for (int i = 0; i < 4; ++i) {
            const std::size_t gone = random() % balls.size();
            REQUIRE(world.destroy(ids[gone]) == Status::ok);
            balls.erase(balls.begin() + static_cast<std::ptrdiff_t>(gone));
            ids.erase(ids.begin() + static_cast<std::ptrdiff_t>(gone));
            spawn(users[random() % users.size()]);
            const std::size_t moves = random() % balls.size();
            balls[moves].at = place();
            REQUIRE(world.place(ids[moves], {balls[moves].at, {}}) == Status::ok);
          }
          if (frame == 6) {
            const UserId left = users.back();
            users.pop_back();
            REQUIRE(world.disconnect(left) == Status::ok);
            for (std::size_t i = balls.size(); i-- > 0;) {
              if (balls[i].user != left) continue;
              balls.erase(balls.begin() + static_cast<std::ptrdiff_t>(i));
              ids.erase(ids.begin() + static_cast<std::ptrdiff_t>(i));
            }
          }
        }
      }
    }
  }
}

TEST_CASE(
    "a thousand avatars of one user on one spot make few candidates "
    "among themselves") {
  WorldConfig config;
  config.nodes = 0;
  config.bounds_max = {50, 50, 50};
  World world(config);
  const ShapeId shape = world.add_shape(Sphere{0.5f});
  const UserId user = world.connect().user;
  for (int i = 0; i < 1000; ++i) {
    REQUIRE(
        world.spawn({.shape = shape, .category = Category::avatar, .user = user, .pose = {{25, 25, 25}, {}}}).status ==
        Status::ok);
  }
  advance(world);
  CHECK(world.report().candidates == 32 * 31 / 2);
  CHECK(world.contacts().size() == 32 * 31 / 2);
}

TEST_CASE(
    "spawns and moves beyond a user's quota of a window are refused and "
    "counted for that user alone") {
  WorldConfig config;
  config.nodes = 0;
  config.quotas.spawns = 3;
  config.quotas.moves = 5;
  config.quotas.window = 2;
  World world(config);
  const ShapeId shape = world.add_shape(Sphere{1});
  const UserId greedy = world.connect().user, modest = world.connect().user;
  const auto spawn = [&](UserId user) {
    return world.spawn({.shape = shape, .category = Category::avatar, .user = user, .pose = {}});
  };
  const ObjectId own = spawn(modest).id, first = spawn(greedy).id;
  REQUIRE(spawn(greedy).status == Status::ok);
  REQUIRE(spawn(greedy).status == Status::ok);
  CHECK(spawn(greedy).status == Status::over_quota);
  CHECK(world.refused(greedy) == 1);
  for (int window = 0; window < 3; ++window) {
    for (int i = 0; i < 5; ++i)
      CHECK((i % 2 == 0 ? world.move(greedy, first, {}) : world.input(greedy, first, {})) == Status::ok);
    for (int frame = 0; frame < 2; ++frame) {
      CHECK(world.move(greedy, first, {}) == Status::over_quota);
      CHECK(world.input(greedy, first, {}) == Status::over_quota);
      CHECK(world.move(modest, own, {}) == Status::ok);
      REQUIRE(world.advance() == Status::ok);
      CHECK(refused(world, Status::over_quota) == (window == 0 && frame == 0 ? 3u : 2u));
    }
  }
  CHECK(world.refused(greedy) == 1 + 3 * 4);
  CHECK(world.refused(modest) == 0);
  CHECK(spawn(greedy).status == Status::ok);
  CHECK(world.refused(UserId(77)) == 0);
}

TEST_CASE(
    "with the default quotas nothing of an honest user is refused, in "
    "every deployment") {
  for (const Deployment deployment : {Deployment::user, Deployment::user_server, Deployment::user_collision}) {
    WorldConfig config;
    config.nodes = 0;
    config.deployment = deployment;
    World world(config);
    const ShapeId shape = world.add_shape(Sphere{0.25f});
    const UserId user = world.connect().user;
    std::vector<ObjectId> avatars;
    for (int i = 0; i < 200; ++i) {
      avatars.push_back(
          world.spawn({.shape = shape, .category = Category::avatar, .user = user, .pose = {{1.0 * i, 0, 0}, {}}}).id);
    }
    for (int frame = 0; frame < 70; ++frame) {
      for (std::size_t i = 0; i < avatars.size(); ++i) {
        REQUIRE(world.move(user, avatars[i], {{1.0 * static_cast<double>(i), 0.01 * frame, 0}, {}}) == Status::ok);
      }
      advance(world);
    }
    CHECK(world.refused(user) == 0);
  }
}
