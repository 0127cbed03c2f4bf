#include <concepts>
#include <cstdint>
#include <memory>
#include <type_traits>
#include <utility>
#include <vector>

#include <doctest/doctest.h>

#include "facade/bouncing_world.hpp"
#include "ringfence/digest.hpp"
#include "ringfence/world.hpp"

namespace ringfence::test {
namespace {

static_assert(std::is_nothrow_move_constructible_v<World> && std::is_nothrow_move_assignable_v<World>);
static_assert(!std::copyable<World>);

constexpr double side = 11;

WorldConfig bouncing(std::uint32_t nodes) {
  WorldConfig config;
  config.bounds_max = {side, side, side};
  config.nodes = nodes;
  config.interest = 4;
  config.motion = std::make_shared<BouncingModel>(side);
  return config;
}

World populated(std::uint32_t nodes) {
  World world(bouncing(nodes));
  populate(world, 100, 4, side);
  return world;
}

std::uint64_t digest_without_moves() {
  World world = populated(0);
  Digest digest;
  for (int frame = 0; frame < 12; ++frame) {
    REQUIRE(world.advance() == Status::ok);
    digest.add_frame(world.contacts());
  }
  return digest.value();
}

TEST_CASE("a world that is moved between frames and within a frame finds the same contacts") {
  const std::uint64_t expected = digest_without_moves();
  for (const std::uint32_t nodes : {0u, 1u, 3u}) {
    CAPTURE(nodes);
    Digest digest;
    std::vector<World> worlds;
    worlds.push_back(populated(nodes));
    for (int frame = 0; frame < 12; ++frame) {
      World between = std::move(worlds.back());
      worlds.pop_back();
      REQUIRE(between.begin_frame() == Status::ok);
      World within = std::move(between);
      REQUIRE(within.finish_frame() == Status::ok);
      digest.add_frame(within.contacts());
      worlds.push_back(std::move(within));
    }
    CHECK(digest.value() == expected);
  }
}

TEST_CASE("spans, references and ids of a world stay valid when it is moved") {
  World world = populated(2);
  REQUIRE(world.advance() == Status::ok);
  const auto contacts = world.contacts();
  const FrameReport* const report = &world.report();
  const ObjectId object = world.find(1);
  const World moved = std::move(world);
  CHECK(moved.contacts().data() == contacts.data());
  CHECK(&moved.report() == report);
  CHECK(moved.object(object).id == object);
}

TEST_CASE("assignment ends the world that it replaces, also in a frame, and that which was moved from can be reused") {
  for (const std::uint32_t nodes : {0u, 2u}) {
    CAPTURE(nodes);
    World world = populated(nodes);
    World other = populated(nodes);
    REQUIRE(other.advance() == Status::ok);
    REQUIRE(world.begin_frame() == Status::ok);
    world = std::move(other);
    CHECK(world.frames() == 1);
    REQUIRE(world.advance() == Status::ok);
    other = populated(nodes);
    REQUIRE(other.advance() == Status::ok);
    CHECK(other.frames() == 1);
    World& same = world;
    world = std::move(same);
    CHECK(world.frames() == 2);
    CHECK(world.advance() == Status::ok);
  }
}

}  // namespace
}  // namespace ringfence::test
