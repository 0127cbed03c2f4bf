#include <cstdint>
#include <iterator>
#include <map>
#include <memory>
#include <string>
#include <vector>

#include <doctest/doctest.h>

#include "facade/bouncing_world.hpp"
#include "ringfence/digest.hpp"
#include "ringfence/world.hpp"

namespace ringfence::test {
namespace {

constexpr double side = 11;

using Schedule = std::map<int, std::uint32_t>;

struct Run {
  std::uint64_t digest = 0;
  std::uint64_t contacts = 0;
  std::uint32_t epoch = 0;
};

// A crowd in a corner of the world, so that regions follow it, and many resting objects.
Run run(WorldConfig config, const Schedule& schedule, Caller caller = Caller::usual) {
  config.bounds_max = {60, 60, 60};
  config.interest = 4;
  config.motion = std::make_shared<BouncingModel>(side);
  const auto made = call_from(caller, [&] { return std::make_unique<World>(config); });
  World& world = *made;
  populate(world, 160, 4, side, caller);
  Digest digest;
  Run result;
  for (int frame = 0; frame < 36; ++frame) {
    if (const auto at = schedule.find(frame); at != schedule.end()) REQUIRE(world.resize(at->second) == Status::ok);
    REQUIRE(call_from(caller, [&] { return world.advance(); }) == Status::ok);
    const FrameReport& report = world.report();
    REQUIRE(report.tested + report.carried == report.candidates);
    REQUIRE(report.accepted == report.candidates);
    digest.add_frame(world.contacts());
    result.contacts += report.contacts;
  }
  result.digest = digest.value();
  result.epoch = world.report().map_epoch;
  return result;
}

TEST_CASE("placement, node count, resizing, balancing and keep_resting change no contact") {
  WorldConfig plain;
  plain.nodes = 0;
  const Run expected = run(plain, {});
  CHECK(expected.contacts > 1000);
  const std::vector<Schedule> schedules = {{}, {{2, 3}, {3, 1}, {20, 5}}, {{0, 16}, {1, 2}, {30, 7}}};
  std::uint32_t changed = 0;
  std::size_t next = 0;
  for (const std::uint32_t nodes : {0u, 1u, 2u, 3u, 5u, 8u, 16u}) {
    for (const Placement placement : {Placement::server, Placement::region, Placement::automatic}) {
      for (const bool balance : {true, false}) {
        for (const bool keep_resting : {true, false}) {
          // Three schedules, four callers and four settings: the loops combine each with each.
          const Caller caller = callers[next / schedules.size() % std::size(callers)];
          const std::size_t schedule = next++ % schedules.size();
          CAPTURE(std::string(name_of(caller)));
          CAPTURE(nodes);
          CAPTURE(name_of(placement));
          CAPTURE(balance);
          CAPTURE(keep_resting);
          CAPTURE(schedule);
          WorldConfig config;
          config.nodes = nodes;
          config.placement = placement;
          config.balance = balance;
          config.tuning.keep_resting = keep_resting;
          const Run other = run(config, schedules[schedule], caller);
          CHECK(other.digest == expected.digest);
          changed += schedule == 0 && other.epoch > 1 ? 1 : 0;
        }
      }
    }
  }
  CHECK(changed > 0);  // some maps followed the load by themselves
}

TEST_CASE(
    "the default placement is server for one node with its own thread and region otherwise, and config() returns it") {
  for (const std::uint32_t nodes : {0u, 1u, 2u, 5u}) {
    WorldConfig config;
    config.nodes = nodes;
    CHECK(config.placement == Placement::automatic);
    CHECK(World(config).config().placement == (nodes == 1 ? Placement::server : Placement::region));
  }
}

}  // namespace
}  // namespace ringfence::test
