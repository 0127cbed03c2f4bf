#include <iterator>
#include <memory>
#include <numeric>
#include <string>

#include <doctest/doctest.h>

#include "facade/bouncing_world.hpp"
#include "ringfence/digest.hpp"
#include "ringfence/world.hpp"

namespace ringfence::test {
namespace {

constexpr double side = 14;

WorldConfig config_of(Deployment deployment, Placement placement, std::uint32_t nodes) {
  WorldConfig config;
  config.bounds_max = {side, side, side};
  config.deployment = deployment;
  config.placement = placement;
  config.nodes = nodes;
  config.user_threads = 2;
  config.interest = 4;
  config.motion = std::make_shared<BouncingModel>(side);
  return config;
}

struct Run {
  std::uint64_t digest = 0;
  std::uint64_t contacts = 0;
  std::uint64_t candidates = 0;
  std::uint64_t handed_over = 0;
};

void check_counts(const FrameReport& report) {
  REQUIRE(report.tested + report.carried == report.candidates);
  REQUIRE(report.accepted == report.candidates);
  for (const std::uint64_t refused : report.refused) {
    REQUIRE(refused == 0);
  }
  std::uint64_t candidates = 0, hits = 0, timed = 0, by_cost = 0;
  for (const KindReport& kind : report.kinds) {
    candidates += kind.candidates;
    hits += kind.hits;
    timed += kind.timed;
    by_cost += std::accumulate(kind.cost.begin(), kind.cost.end(), std::uint64_t{0});
    REQUIRE(kind.lanes >= kind.lanes_filled);
    REQUIRE(kind.nanoseconds >= kind.gather_nanoseconds);
  }
  REQUIRE(candidates == report.tested);
  REQUIRE((report.carried > 0 ? hits <= report.contacts : hits == report.contacts));
  REQUIRE(by_cost == timed);
}

// Spawns pairs in contact. Some coordinates of their positions, contact points and normals are subnormal as double or
// as float: an environment with flush-to-zero replaces such numbers by 0.
void spawn_subnormal(World& world, Caller caller) {
  const ShapeId ball = call_from(caller, [&] { return world.add_shape(Sphere{0.5f}); });
  const double far = side + 3;
  const double places[][2] = {{3e-310, 3e-310}, {-1e-40, 1e-40}, {1e-42, 3e-308}};
  for (std::size_t i = 0; i < std::size(places); ++i) {
    const double y = far + 3 * static_cast<double>(i);
    ObjectSpec spec;
    spec.shape = ball;
    spec.category = Category::fixed;
    spec.pose.position = {places[i][0], y, far};
    REQUIRE(call_from(caller, [&] { return world.spawn(spec); }).status == Status::ok);
    spec.category = Category::non_active;
    spec.pose.position = {places[i][1], y, far + 0.75};
    REQUIRE(call_from(caller, [&] { return world.spawn(spec); }).status == Status::ok);
  }
}

Run run(const WorldConfig& config, std::size_t objects, std::size_t users, int frames, Caller caller = Caller::usual) {
  const auto made = call_from(caller, [&] { return std::make_unique<World>(config); });
  World& world = *made;
  populate(world, objects, users, side, caller);
  spawn_subnormal(world, caller);
  Digest digest;
  Run result;
  for (int frame = 0; frame < frames; ++frame) {
    REQUIRE(call_from(caller, [&] { return world.advance(); }) == Status::ok);
    check_counts(world.report());
    digest.add_frame(world.contacts());
    result.contacts += world.contacts().size();
    result.candidates += world.report().candidates;
    result.handed_over += world.report().handed_over;
  }
  result.digest = digest.value();
  return result;
}

TEST_CASE("every deployment, placement and node count gives the same contacts bit for bit") {
  const Run expected = run(config_of(Deployment::user, Placement::server, 0), 400, 10, 40);
  REQUIRE(expected.contacts > 1000);
  for (const Deployment deployment : {Deployment::user, Deployment::user_server, Deployment::user_collision}) {
    for (const Placement placement : {Placement::server, Placement::region}) {
      for (const std::uint32_t nodes : {0u, 1u, 2u, 3u, 8u, 16u}) {
        CAPTURE(name_of(deployment));
        CAPTURE(name_of(placement));
        CAPTURE(nodes);
        const Run got = run(config_of(deployment, placement, nodes), 400, 10, 40);
        CHECK(got.digest == expected.digest);
        CHECK(got.candidates == expected.candidates);
        if (deployment == Deployment::user_collision && nodes > 1) {
          CHECK(got.handed_over > 0);
        }
      }
    }
  }
}

TEST_CASE("the contacts are the same bit for bit whatever the caller's floating-point environment") {
  const Run expected = run(config_of(Deployment::user, Placement::server, 0), 400, 10, 20);
  REQUIRE(expected.contacts > 500);
  for (const Deployment deployment : {Deployment::user, Deployment::user_server, Deployment::user_collision}) {
    for (const Placement placement : {Placement::server, Placement::region}) {
      for (const std::uint32_t nodes : {0u, 1u, 3u}) {
        for (const Caller caller : {Caller::flushing, Caller::rounding_up, Caller::trapping}) {
          CAPTURE(name_of(deployment));
          CAPTURE(name_of(placement));
          CAPTURE(nodes);
          CAPTURE(std::string(name_of(caller)));
          const Run got = run(config_of(deployment, placement, nodes), 400, 10, 20, caller);
          CHECK(got.digest == expected.digest);
          CHECK(got.candidates == expected.candidates);
        }
      }
    }
  }
}

}  // namespace
}  // namespace ringfence::test
