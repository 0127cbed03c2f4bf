#include <cmath>
#include <cstdint>
#include <map>
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

// Multiples of 2^-8 m: exact up to 2^44 m, so that contacts do not depend on the place.
double exact(double metres) { return std::round(metres * 256) / 256; }

// Spheres with radius 1 m at random places of a cube with its lower corner at (from, from, from).
std::vector<Vec3d> places(std::size_t count, double side, double from, std::mt19937_64& random) {
  std::uniform_real_distribution<double> within(0, side);
  std::vector<Vec3d> out;
  for (std::size_t i = 0; i < count; ++i) {
    const double x = exact(within(random)), y = exact(within(random)), z = exact(within(random));
    out.push_back({from + x, from + y, from + z});
  }
  return out;
}

Pairs touching(const std::vector<Vec3d>& at) {
  Pairs pairs;
  for (std::uint32_t i = 0; i < at.size(); ++i) {
    for (std::uint32_t j = i + 1; j < at.size(); ++j) {
      const double x = at[i].x - at[j].x, y = at[i].y - at[j].y, z = at[i].z - at[j].z;
      if (x * x + y * y + z * z <= 4) pairs.insert({i + 1, j + 1});
    }
  }
  return pairs;
}

struct Outcome {
  Pairs pairs;
  std::uint64_t candidates = 0;
  WorldConfig config;
};

// All objects are spawned before the first frame, with the numbers 1, 2, ... and then placed again.
Outcome run(WorldConfig config, const std::vector<Vec3d>& at) {
  World world(std::move(config));
  const ShapeId ball = world.add_shape(Sphere{1});
  std::vector<ObjectId> ids;
  for (const Vec3d& position : at) ids.push_back(world.spawn({.shape = ball, .pose = {position, {}}}).id);
  Outcome outcome;
  for (int frame = 0; frame < 3; ++frame) {
    advance(world);
    for (std::size_t i = 0; i < at.size(); ++i) REQUIRE(world.place(ids[i], {at[i], {}}) == Status::ok);
  }
  for (const Contact& contact : world.contacts()) outcome.pairs.insert({contact.a, contact.b});
  outcome.candidates = world.report().candidates;
  outcome.config = world.config();
  return outcome;
}

WorldConfig with_bounds(std::uint32_t nodes, double min, double max) {
  WorldConfig config;
  config.nodes = nodes;
  config.bounds_min = {min, min, min};
  config.bounds_max = {max, max, max};
  return config;
}

}  // namespace

TEST_CASE("objects far outside the bounds have nearly as few candidates as inside, and the same contacts") {
  for (const std::uint32_t nodes : {0u, 2u}) {
    for (const double far : {-5e3, 1e3, 1e5}) {
      CAPTURE(nodes);
      CAPTURE(far);
      std::mt19937_64 random(7);
      const std::vector<Vec3d> at = places(1500, 60, far, random);
      const Outcome inside = run(with_bounds(nodes, far, far + 60), at);
      const Outcome outside = run(with_bounds(nodes, 0, 100), at);
      CHECK(inside.pairs == touching(at));
      CHECK(outside.pairs == inside.pairs);
      CHECK(outside.candidates <= inside.candidates * 2);
    }
  }
}

TEST_CASE("objects inside, across the faces and at any distance outside are in the contacts of brute force") {
  for (const std::uint32_t nodes : {0u, 3u}) {
    std::mt19937_64 random(8);
    std::vector<Vec3d> at = places(600, 30, -10, random);
    for (const double far : {15.0, 1e4, -1e7, 1e12}) {
      const std::vector<Vec3d> more = places(120, 10, far, random);
      at.insert(at.end(), more.begin(), more.end());
    }
    for (const double far : {1e15, -1e15}) at.push_back({far, far, far});
    CHECK(run(with_bounds(nodes, 0, 16), at).pairs == touching(at));
  }
}

TEST_CASE("the World chooses bounds around the first objects, and contacts do not depend on them") {
  for (const std::uint32_t nodes : {0u, 2u}) {
    CAPTURE(nodes);
    std::mt19937_64 random(9);
    std::vector<Vec3d> at = places(1500, 400, -700, random);
    at.push_back({1e15, 0, 0});
    at.push_back({-699, -1e15, 3e14});
    WorldConfig open;
    open.nodes = nodes;
    const Outcome chosen = run(open, at);
    CHECK(chosen.config.bounds_min.x > -1000);
    CHECK(chosen.config.bounds_min.x <= -699);
    CHECK(chosen.config.bounds_max.x < 0);
    CHECK(chosen.pairs == touching(at));
    const Outcome right = run(with_bounds(nodes, -700, -300), at);
    CHECK(right.pairs == chosen.pairs);
    CHECK(chosen.candidates <= right.candidates + right.candidates / 10 + 10);
  }
}

TEST_CASE("without objects the bounds are 0 to 100 m, until a frame has the first ones") {
  World world(WorldConfig{});
  const ShapeId ball = world.add_shape(Sphere{1});
  advance(world);
  CHECK(world.config().bounds_min == Vec3d{0, 0, 0});
  CHECK(world.config().bounds_max == Vec3d{100, 100, 100});
  const ObjectId first = world.spawn({.shape = ball, .pose = {{1e6, 0, -1e6}, {}}}).id;
  const ObjectId second = world.spawn({.shape = ball, .pose = {{1e6 + 1, 0, -1e6}, {}}}).id;
  CHECK(world.config().bounds_max == Vec3d{100, 100, 100});
  advance(world);
  CHECK(world.config().bounds_min.x > 1e6 - 100);
  CHECK(world.contacts().size() == 1);
  const Vec3d chosen = world.config().bounds_min;
  REQUIRE(world.destroy(first) == Status::ok);
  REQUIRE(world.place(second, {{5, 5, 5}, {}}) == Status::ok);
  (void)world.spawn({.shape = ball, .pose = {{6, 5, 5}, {}}});
  advance(world);
  CHECK(world.config().bounds_min == chosen);
  CHECK(world.contacts().size() == 1);
}
