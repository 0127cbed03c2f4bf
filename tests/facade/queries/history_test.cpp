// Queries about earlier frames, and about the time between two.
#include <limits>
#include <vector>

#include <doctest/doctest.h>

#include "facade/checks.hpp"
#include "facade/queries/all_objects.hpp"
#include "facade/queries/changing_world.hpp"
#include "facade/queries/random_queries.hpp"
#include "facade/script.hpp"
#include "ringfence/world.hpp"

namespace ringfence::test {
namespace {

std::vector<ShapeId> all_shapes(const World& world) {
  std::vector<ShapeId> out;
  for (std::uint32_t i = 0; i < world.shape_count(); ++i) out.emplace_back(i);
  return out;
}

TEST_CASE("a query about a frame of the history has the bits that it had when that frame was the last") {
  constexpr std::uint64_t history = 5;
  in_all_worlds(world_with_history(history), {0u, 2u}, [&](const WorldConfig& config) {
    World world(config);
    Script script(world, 3, cube_side);
    script.make_requests();
    advance(world);
    const Queries queries = make_queries(world, all_shapes(world), cube_side, 6, 1);
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
      const Queries queries = make_queries(world, changing.shapes, cube_side, 12, static_cast<unsigned>(round));
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
