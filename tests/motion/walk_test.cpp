#include "motion/walk.hpp"

#include <cmath>
#include <cstring>
#include <memory>
#include <random>
#include <vector>

#include <doctest/doctest.h>

#include "ringfence/error.hpp"
#include "ringfence/world.hpp"

namespace ringfence::motion {
namespace {

/// Avatars that walk in a world of a hundred metres, whose middle is at (0, 0).
class Walkers {
 public:
  explicit Walkers(std::uint32_t nodes = 0, const WalkConfig& walk = walk_config()) : world_(config(nodes, walk)) {
    capsule_ = world_.add_shape(Capsule{0.35f, 0.55f});
    wall_ = world_.add_shape(Box{{0.5f, 5, 2}});
    ball_ = world_.add_shape(Sphere{0.5f});
  }
  static WalkConfig walk_config() {
    WalkConfig walk;
    walk.bounds_min = {-50, -50, 0};
    walk.bounds_max = {50, 50, 10};
    return walk;
  }

  ObjectId add_avatar(double x, double y) {
    const UserId user = world_.connect().user;
    users_.push_back(user);
    return add({.shape = capsule_, .category = Category::avatar, .user = user, .pose = {{x, y, 0.9}, {}}});
  }
  ObjectId add_wall(double x, double y) {
    return add({.shape = wall_, .category = Category::fixed, .pose = {{x, y, 2}, {}}});
  }
  ObjectId add_ball(double x, double y, Category category = Category::non_active) {
    const std::uint64_t user_data = category == Category::non_active ? gives_way : 0;
    return add({.shape = ball_, .category = category, .user_data = user_data, .pose = {{x, y, 0.9}, {}}});
  }
  void wish(ObjectId avatar, std::int8_t x, std::int8_t y, bool runs = false, std::uint16_t heading = 0) {
    const auto bytes = WalkInput{x, y, heading, runs}.bytes();
    input(avatar, bytes);
  }
  void input(ObjectId avatar, std::span<const std::byte> bytes) {
    const UserId user = world_.object(avatar).spec.user;
    CHECK(world_.input(user, avatar, bytes) == Status::ok);
  }
  void advance(int frames = 1) {
    for (int i = 0; i < frames; ++i) CHECK(world_.advance() == Status::ok);
  }
  Vec3d position(ObjectId object) const { return world_.object(object).spec.pose.position; }
  World& world() { return world_; }

 private:
  static WorldConfig config(std::uint32_t nodes, const WalkConfig& walk) {
    WorldConfig config;
    config.nodes = nodes;
    config.bounds_min = walk.bounds_min;
    config.bounds_max = walk.bounds_max;
    config.motion = std::make_shared<Walk>(walk);
    config.quotas = {};
    return config;
  }
  ObjectId add(const ObjectSpec& spec) {
    const Spawned spawned = world_.spawn(spec);
    CHECK(spawned.status == Status::ok);
    return spawned.id;
  }

  World world_;
  ShapeId capsule_, wall_, ball_;
  std::vector<UserId> users_;
};

double distance(const Vec3d& a, const Vec3d& b) { return std::hypot(a.x - b.x, a.y - b.y, a.z - b.z); }

}  // namespace

TEST_CASE("an avatar reaches its walking or running speed, in any direction, and stands without input") {
  const double step = 0.05;
  for (const bool runs : {false, true}) {
    for (const auto& [x, y] : {std::pair{127, 0}, {0, -127}, {127, 127}, {-128, 90}}) {
      Walkers walkers;
      const ObjectId avatar = walkers.add_avatar(0, 0);
      walkers.advance();
      double fastest = 0;
      Vec3d before = walkers.position(avatar);
      for (int frame = 0; frame < 20; ++frame) {
        walkers.wish(avatar, static_cast<std::int8_t>(x), static_cast<std::int8_t>(y), runs);
        walkers.advance();
        const Vec3d now = walkers.position(avatar);
        const double speed = distance(now, before) / step;
        // The acceleration of 20 m/s^2 adds at most 1 m/s in a frame.
        CHECK(speed <= fastest + 1.0001);
        fastest = std::max(fastest, speed);
        before = now;
      }
      CHECK(fastest == doctest::Approx(runs ? 5.0 : 2.5).epsilon(0.001));
      CHECK(before.z == 0.9);
      const Vec3d way = {before.x / std::hypot(before.x, before.y), before.y / std::hypot(before.x, before.y), 0};
      CHECK(way.x == doctest::Approx(x / std::hypot(x, y)).epsilon(0.001));
      CHECK(way.y == doctest::Approx(y / std::hypot(x, y)).epsilon(0.001));
      walkers.advance(6);
      before = walkers.position(avatar);
      walkers.advance();
      CHECK(walkers.position(avatar) == before);
    }
  }
}

TEST_CASE("an input of another length is standing still, and a slow wish is a slow walk") {
  Walkers walkers;
  const ObjectId confused = walkers.add_avatar(0, 0), slow = walkers.add_avatar(0, 10);
  walkers.advance();
  const std::vector<std::byte> nonsense(7, std::byte{0x7f});
  for (int frame = 0; frame < 40; ++frame) {
    walkers.input(confused, nonsense);
    walkers.wish(slow, 51, 0);
    walkers.advance();
  }
  CHECK(walkers.position(confused) == Vec3d{0, 0, 0.9});
  CHECK(walkers.position(slow).x == doctest::Approx(40 * 0.05 * 2.5 * 51 / 127).epsilon(0.05));
}

TEST_CASE("a wall stops an avatar, which slides along it, and a ball is pushed") {
  Walkers walkers;
  walkers.add_wall(3, 0);
  const ObjectId walker = walkers.add_avatar(0, 0), pusher = walkers.add_avatar(0, 20);
  const ObjectId ball = walkers.add_ball(3, 20);
  walkers.advance();
  for (int frame = 0; frame < 60; ++frame) {
    walkers.wish(walker, 127, 30);
    walkers.wish(pusher, 127, 0);
    walkers.advance();
    // The wall begins at 2.5 m and the avatar has a radius of 0.35 m; one step of 0.125 m may overlap.
    CHECK(walkers.position(walker).x < 2.5 - 0.35 + 0.125 + 0.02);
  }
  CHECK(walkers.position(walker).x > 2.1);
  CHECK(walkers.position(walker).y > 1);
  CHECK(walkers.position(ball).x > 4);
  CHECK(walkers.position(pusher).x > 2.5);
  // They overlap by at most what the model allows.
  CHECK(walkers.position(ball).x - walkers.position(pusher).x > 0.85 - 0.12 - 0.02);
}

TEST_CASE("an avatar that pushes a ball against a wall does not pass through it") {
  Walkers walkers;
  walkers.add_wall(4, 0);
  const ObjectId pusher = walkers.add_avatar(0, 0), ball = walkers.add_ball(2, 0);
  walkers.advance();
  for (int frame = 0; frame < 200; ++frame) {
    walkers.wish(pusher, 127, 0, true);
    walkers.advance();
  }
  CHECK(walkers.position(ball).x < 3.5 - 0.5 + 0.2);
  CHECK(walkers.position(pusher).x < walkers.position(ball).x - 0.6);
}

TEST_CASE("nothing leaves the bounds") {
  Walkers walkers;
  const ObjectId avatar = walkers.add_avatar(48, -48);
  std::vector<ObjectId> figures;
  for (int i = 0; i < 20; ++i) figures.push_back(walkers.add_ball(49, -45 + 4 * i, Category::active));
  for (int frame = 0; frame < 300; ++frame) {
    if (frame > 0) walkers.wish(avatar, 127, -127, true);
    walkers.advance();
  }
  CHECK(walkers.position(avatar).x == 50);
  CHECK(walkers.position(avatar).y == -50);
  for (const ObjectId figure : figures) {
    CHECK(std::abs(walkers.position(figure).x) <= 50);
    CHECK(std::abs(walkers.position(figure).y) <= 50);
    CHECK(walkers.position(figure).z == 0.9);
  }
}

TEST_CASE("a crowd moves in the same way at any number of nodes") {
  const auto states_at = [](std::uint32_t nodes) {
    Walkers walkers(nodes);
    std::mt19937_64 random(3);
    std::vector<ObjectId> avatars;
    for (int i = 0; i < 30; ++i) avatars.push_back(walkers.add_avatar(i % 6 - 3, (i - i % 6) / 6.0 - 3));
    for (int i = 0; i < 30; ++i) static_cast<void>(walkers.add_ball(i - 15, 6, Category::active));
    walkers.advance();
    for (int frame = 0; frame < 100; ++frame) {
      for (const ObjectId avatar : avatars) {
        const std::uint64_t bits = random();
        walkers.wish(avatar, static_cast<std::int8_t>(bits), static_cast<std::int8_t>(bits >> 8), bits >> 63 != 0,
                     static_cast<std::uint16_t>(bits >> 16));
      }
      walkers.advance();
    }
    std::vector<Pose> poses;
    for (const ObjectView& object : walkers.world().objects()) poses.push_back(object.spec.pose);
    return poses;
  };
  const std::vector<Pose> expected = states_at(0);
  CHECK(expected.size() == 60);
  for (const std::uint32_t nodes : {1u, 3u}) {
    const std::vector<Pose> found = states_at(nodes);
    REQUIRE(found.size() == expected.size());
    CHECK(std::memcmp(found.data(), expected.data(), found.size() * sizeof(Pose)) == 0);
  }
}

TEST_CASE("inputs are read back, and headings become rotations about z") {
  for (const WalkInput& input : {WalkInput{1, -1, 65535, true}, WalkInput{-128, 127, 1, false}, WalkInput{}}) {
    const WalkInput back = WalkInput::of(input.bytes());
    CHECK(back.x == input.x);
    CHECK(back.y == input.y);
    CHECK(back.heading == input.heading);
    CHECK(back.runs == input.runs);
  }
  for (std::uint32_t heading = 0; heading < 65536; heading += 7) {
    const double half = heading * 3.14159265358979323846 / 65536;
    const Quat turn = rotation_of(static_cast<std::uint16_t>(heading));
    CHECK(turn.x == 0);
    CHECK(turn.y == 0);
    CHECK(std::abs(double{turn.z} - std::sin(half)) < 1e-6);
    CHECK(std::abs(double{turn.w} - std::cos(half)) < 1e-6);
  }
}

TEST_CASE("a configuration out of range is refused, and another configuration is another version") {
  const auto changed = [](auto change) {
    WalkConfig config;
    change(config);
    return config;
  };
  CHECK_THROWS_AS(Walk(changed([](WalkConfig& c) { c.step = 0; })), Error);
  CHECK_THROWS_AS(Walk(changed([](WalkConfig& c) { c.run_speed = 1; })), Error);
  CHECK_THROWS_AS(Walk(changed([](WalkConfig& c) { c.walk_speed = std::nanf(""); })), Error);
  CHECK_THROWS_AS(Walk(changed([](WalkConfig& c) { c.acceleration = -1; })), Error);
  CHECK_THROWS_AS(Walk(changed([](WalkConfig& c) { c.bounds_max.x = c.bounds_min.x; })), Error);
  CHECK(Walk(WalkConfig{}).version() == Walk(WalkConfig{}).version());
  CHECK(Walk(WalkConfig{}).version() != Walk(changed([](WalkConfig& c) { c.step = 0.1f; })).version());
}

}  // namespace ringfence::motion
