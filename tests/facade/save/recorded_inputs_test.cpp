#include "facade/save/recorded_inputs.hpp"

#include <cstddef>
#include <cstdint>
#include <memory>
#include <random>
#include <vector>

#include <doctest/doctest.h>

#include "facade/script.hpp"
#include "geometry/ellipsoid.hpp"
#include "ringfence/recorder.hpp"
#include "ringfence/world.hpp"

namespace ringfence::test {
namespace {

constexpr double side = 9;

/// Keeps the inputs of every frame, and the world before the first frame that it is asked for.
class Keeper final : public Recorder {
 public:
  bool begin_frame(World& world, std::span<const std::byte> inputs) override {
    if (world.frames() == wanted) REQUIRE(world.save(save) == Status::ok);
    frames.emplace_back(inputs.begin(), inputs.end());
    return !refuses;
  }
  bool finish_frame(World&, bool is_reproducible) override {
    reproducible.push_back(is_reproducible);
    return !fails;
  }
  std::uint64_t wanted = 0;
  bool refuses = false, fails = false;
  MemorySink save;
  std::vector<std::vector<std::byte>> frames;
  std::vector<bool> reproducible;
};

WorldConfig config_of(std::uint32_t nodes) {
  WorldConfig config;
  config.nodes = nodes;
  config.layers = {{"a", "b"}, {{0, 0}, {0, 1}}};
  config.motion = std::make_shared<BouncingModel>(side);
  config.support_functions = {std::make_shared<Ellipsoid>(Vec3f{0.5f, 0.7f, 0.9f})};
  return config;
}

World restore(const Keeper& keeper, std::uint32_t nodes) {
  MemorySource source(keeper.save.bytes());
  return World(config_of(nodes), source);
}

TEST_CASE("the same inputs make the same frames, and a frame without requests has none") {
  const auto keeper = std::make_shared<Keeper>();
  keeper->wanted = 10;
  WorldConfig config = config_of(1);
  config.recorder = keeper;
  World world(config);
  Script script(world, 5, side);
  std::vector<std::uint64_t> expected;
  for (int frame = 0; frame < 30; ++frame) {
    if (frame != 20) script.make_requests();
    REQUIRE(world.advance() == Status::ok);
    expected.push_back(fingerprint(world));
  }
  CHECK(keeper->frames[20].empty());
  CHECK(keeper->reproducible == std::vector<bool>(30, true));
  const UserId next = world.connect().user;
  for (const std::uint32_t nodes : {0u, 3u}) {
    World again = restore(*keeper, nodes);
    for (std::size_t frame = 10; frame < 30; ++frame) {
      REQUIRE(again.apply(keeper->frames[frame]) == Status::ok);
      REQUIRE(again.advance() == Status::ok);
      CHECK(fingerprint(again) == expected[frame]);
    }
    CHECK(again.connect().user == next);
  }
}

TEST_CASE("a refused call takes no number, so a world that has not seen it gives the same numbers") {
  WorldConfig config;
  config.quotas.spawns = 1;
  World world(config);
  const ShapeId ball = world.add_shape(Sphere{1});
  const UserId user = world.connect().user;
  const ObjectSpec avatar{.shape = ball, .category = Category::avatar, .user = user};
  REQUIRE(world.spawn(avatar).id.number() == 1);
  CHECK(world.spawn(avatar).status == Status::over_quota);
  CHECK(world.spawn({.shape = ShapeId(7)}).status == Status::unknown_shape);
  CHECK(world.spawn({.shape = ball}).id.number() == 2);
}

TEST_CASE("if the recorder fails, no further frame runs") {
  const auto keeper = std::make_shared<Keeper>();
  WorldConfig config = config_of(1);
  config.recorder = keeper;
  World world(config);
  REQUIRE(world.advance() == Status::ok);
  keeper->fails = true;
  CHECK(world.advance() == Status::journal_failed);
  keeper->fails = false;
  CHECK(world.advance() == Status::journal_failed);
  CHECK(world.frames() == 2);  // it ran, but it is not recorded
  World other(config);
  keeper->refuses = true;
  CHECK(other.advance() == Status::journal_failed);
  CHECK(other.frames() == 0);
}

TEST_CASE("a world either refuses changed inputs or runs with them") {
  const unsigned seed = std::random_device{}();
  CAPTURE(seed);
  std::mt19937_64 random(seed);
  const auto keeper = std::make_shared<Keeper>();
  keeper->wanted = 8;
  WorldConfig config = config_of(0);
  config.recorder = keeper;
  World world(config);
  Script script(world, seed, side);
  for (int frame = 0; frame < 9; ++frame) {
    for (int i = 0; i < 3; ++i) script.make_requests();
    REQUIRE(world.advance() == Status::ok);
  }
  REQUIRE(keeper->frames[8].size() > 200);
  int refused = 0, ran = 0;
  for (int i = 0; i < 300; ++i) {
    // Half of the worlds have the requests pending already, as a save in that frame has.
    std::vector<std::byte> inputs = keeper->frames[8];
    if (i % 3 == 0) {
      inputs.resize(random() % inputs.size());
    } else {
      for (std::uint64_t n = 1 + random() % 3; n > 0; --n) {
        const std::uint64_t draw = random();
        inputs[random() % inputs.size()] = static_cast<std::byte>(draw % 3 == 0 ? 0 : draw % 3 == 1 ? 255 : draw >> 8);
      }
    }
    World other = i % 2 == 0 ? restore(*keeper, 0) : World(config_of(0));
    const Status status = other.apply(inputs);
    if (status == Status::ok) {
      REQUIRE(other.advance() == Status::ok);
      REQUIRE(other.advance() == Status::ok);
    } else {
      REQUIRE(status == Status::bad_message);
    }
    ++(status == Status::ok ? ran : refused);
  }
  CHECK(refused > 0);
  CHECK(ran > 0);
}

}  // namespace
}  // namespace ringfence::test
