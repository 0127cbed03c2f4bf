#include <algorithm>
#include <map>
#include <string>
#include <string_view>
#include <vector>

#include <doctest/doctest.h>

#include "facade/bouncing_world.hpp"
#include "facade/checks.hpp"
#include "facade/views.hpp"
#include "ringfence/digest.hpp"
#include "ringfence/world.hpp"

namespace ringfence::test {
namespace {

constexpr double side = 14;

struct ResizeRun {
  std::uint64_t digest = 0;
  std::uint32_t epoch = 0;
};

ResizeRun run(WorldConfig config, const std::map<int, std::uint32_t>& schedule, int frames) {
  config.bounds_max = {side, side, side};
  config.interest = 4;
  config.motion = std::make_shared<BouncingModel>(side);
  World world(config);
  populate(world, 300, 6, side);
  Digest digest;
  std::uint32_t expected = std::max(1u, config.nodes);
  for (int frame = 0; frame < frames; ++frame) {
    std::uint32_t next = expected;
    if (const auto at = schedule.find(frame); at != schedule.end()) {
      next = at->second;
      REQUIRE(world.resize(next) == Status::ok);
    }
    REQUIRE(world.advance() == Status::ok);
    const FrameReport& report = world.report();
    REQUIRE(report.tested + report.carried == report.candidates);
    REQUIRE(report.accepted == report.candidates);
    // New nodes join in the next frame; leaving nodes still take part in it.
    REQUIRE(world.nodes() == std::max(expected, next));
    expected = next;
    require_views(world, first_users(6));
    digest.add_frame(world.contacts());
    std::uint64_t hosted = 0;
    for (const NodeReport& node : report.nodes) {
      hosted += node.hosted;
    }
    if (config.deployment == Deployment::user_collision) {
      const auto objects = world.objects();
      const auto movable = std::count_if(objects.begin(), objects.end(), [](const ObjectView& view) {
        return view.spec.category == Category::active || view.spec.category == Category::non_active;
      });
      REQUIRE(hosted == static_cast<std::uint64_t>(movable));
    }
  }
  return {digest.value(), world.report().map_epoch};
}

TEST_CASE("nodes that join and leave a running world change no contact, and every object keeps exactly one host") {
  WorldConfig still;
  still.nodes = 0;
  const ResizeRun expected = run(still, {}, 40);
  const std::map<int, std::uint32_t> schedule = {{3, 4}, {9, 2}, {10, 7}, {20, 16}, {21, 1}, {30, 3}};
  for (const Deployment deployment : {Deployment::user, Deployment::user_server, Deployment::user_collision}) {
    for (const Placement placement : {Placement::server, Placement::region}) {
      for (const std::uint32_t nodes : {0u, 1u, 5u}) {
        CAPTURE(name_of(deployment));
        CAPTURE(name_of(placement));
        CAPTURE(nodes);
        WorldConfig config;
        config.deployment = deployment;
        config.placement = placement;
        config.nodes = nodes;
        config.user_threads = 2;
        CHECK(run(config, schedule, 40).digest == expected.digest);
      }
    }
  }
}

TEST_CASE("resizing to 0, beyond the limit or beyond the number of cells is refused and counted") {
  WorldConfig config;
  config.nodes = 0;
  config.tuning.cells_log2[0] = 2;
  World world(config);
  CHECK(world.nodes() == 1);  // one works, in the calling thread
  CHECK(world.resize(0) == Status::bad_number);
  CHECK(world.resize(5) == Status::bad_number);
  CHECK(world.resize(4) == Status::ok);
  CHECK(world.advance() == Status::ok);
  CHECK(world.report().refused[static_cast<std::size_t>(Status::bad_number)] == 2);
  CHECK(world.advance() == Status::ok);
  CHECK(world.nodes() == 4);
}

// Everything stands in one corner, so that at first one of eight nodes has all the work.
struct Corner {
  double busiest_share = 0;  ///< of the tested pairs, over the last frames
  std::uint64_t digest = 0;
  std::uint32_t epoch = 0;
};

Corner run_corner(bool balance, Placement placement, std::uint32_t cells_log2) {
  WorldConfig config;
  config.bounds_max = {100, 100, 100};
  config.nodes = 8;
  config.placement = placement;
  config.balance = balance;
  config.tuning.cells_log2[0] = config.tuning.cells_log2[1] = config.tuning.cells_log2[2] = cells_log2;
  config.motion = std::make_shared<BouncingModel>(side);
  World world(config);
  populate(world, 600, 2, side);
  Digest digest;
  std::vector<std::uint64_t> tested(8);
  std::uint64_t all = 0;
  for (int frame = 0; frame < 120; ++frame) {
    REQUIRE(world.advance() == Status::ok);
    digest.add_frame(world.contacts());
    if (frame >= 100) {
      REQUIRE(world.report().nodes.size() == 8);
      for (std::size_t node = 0; node < 8; ++node) {
        tested[node] += world.report().nodes[node].tested;
        all += world.report().nodes[node].tested;
      }
    }
  }
  return {static_cast<double>(*std::max_element(tested.begin(), tested.end())) / static_cast<double>(all),
          digest.value(), world.report().map_epoch};
}

TEST_CASE("regions follow a crowd in a corner until its nodes share the pairs, and contacts do not change") {
  for (const Placement placement : {Placement::server, Placement::region}) {
    // With cells 1.6 m wide; and with two cells per axis, so that the crowd is in one cell that has to be divided.
    for (const std::uint32_t cells_log2 : {6u, 1u}) {
      CAPTURE(name_of(placement));
      CAPTURE(cells_log2);
      const Corner still = run_corner(false, placement, cells_log2);
      const Corner balanced = run_corner(true, placement, cells_log2);
      CHECK(balanced.digest == still.digest);
      CHECK(still.busiest_share > 0.9);
      CHECK(balanced.epoch > still.epoch);
      // An even share is 1/8. Costs are measured times, so only a coarse bound is certain on a busy machine.
      CHECK(balanced.busiest_share < 0.5);
    }
  }
}

// For each frame: the map epoch and the work of each node under it.
std::vector<std::uint64_t> run_by_pairs(std::uint32_t user_threads, bool pairs_are_expensive, std::uint32_t& epochs) {
  WorldConfig config;
  config.bounds_max = {60, 60, 60};
  config.nodes = 5;
  config.user_threads = user_threads;
  config.placement = Placement::region;
  config.balance_by = BalanceBy::pairs;
  config.timeline = pairs_are_expensive;  // makes pairs more expensive
  config.tuning.remember_axes = !pairs_are_expensive;
  config.motion = std::make_shared<BouncingModel>(side);
  World world(config);
  populate(world, 500, 3, side);
  std::vector<std::uint64_t> all;
  for (int frame = 0; frame < 120; ++frame) {
    REQUIRE(world.advance() == Status::ok);
    const FrameReport& report = world.report();
    all.push_back(report.map_epoch);
    all.push_back(report.handed_over);
    for (const NodeReport& node : report.nodes) {
      all.push_back(node.tested);
      all.push_back(node.hosted);
    }
  }
  epochs = world.report().map_epoch;
  return all;
}

TEST_CASE("balanced by pairs, the maps are the same in every run and shares become even") {
  std::uint32_t epochs = 0;
  const std::vector<std::uint64_t> first = run_by_pairs(1, false, epochs);
  CHECK(epochs > 1);
  CHECK(run_by_pairs(3, true, epochs) == first);
  // In the last frame: five times tested plus hosted.
  std::uint64_t most = 0, all = 0;
  for (std::size_t node = 0; node < 5; ++node) {
    const std::uint64_t tested = first[first.size() - 10 + 2 * node];
    most = std::max(most, tested);
    all += tested;
  }
  CHECK(5 * most < 2 * all);  // at first one node has nearly everything
}

TEST_CASE(
    "when there is no thread for a new node, resize is refused, the number of nodes stays, and a later resize works") {
  WorldConfig config;
  config.nodes = 2;
  config.bounds_max = {side, side, side};
  config.motion = std::make_shared<BouncingModel>(side);
  std::vector<std::string> errors;
  config.log = [&](LogLevel level, std::string_view line) {
    if (level == LogLevel::error) errors.emplace_back(line);
  };
  World world(config);
  populate(world, 200, 4, side);
  advance(world);
  for (const std::uint32_t succeed_first : {0u, 1u, 3u}) {
    CAPTURE(succeed_first);
    errors.clear();
    world.fail_thread_creation(succeed_first);
    CHECK(world.resize(6) == Status::no_thread);
    REQUIRE(errors.size() == 1);
    CHECK(errors[0].find("the number of nodes stays 2; resize to fewer, or raise the limit on threads") !=
          std::string::npos);
    REQUIRE(world.advance() == Status::ok);
    CHECK(refused(world, Status::no_thread) == 1);
    CHECK(world.nodes() == 2);
    advance(world);
  }
  REQUIRE(world.resize(6) == Status::ok);
  advance(world);
  advance(world);
  CHECK(world.nodes() == 6);
  REQUIRE(world.resize(8) == Status::ok);
  REQUIRE(world.resize(3) == Status::ok);  // the threads of the other new nodes end
  advance(world);
  advance(world);
  CHECK(world.nodes() == 3);
}

TEST_CASE("when a node is lost before others join and one of them gets no thread, the frame runs without them") {
  WorldConfig config;
  config.nodes = 3;
  config.deadlines.node_ms = 60;
  config.bounds_max = {side, side, side};
  config.motion = std::make_shared<BouncingModel>(side);
  World world(config);
  populate(world, 200, 4, side);
  REQUIRE(world.advance() == Status::ok);
  REQUIRE(world.inject({NodeId(1), 1, NodeStage::moving, 0}) == Status::ok);
  REQUIRE(world.begin_frame() == Status::ok);
  REQUIRE(world.resize(4) == Status::ok);  // three nodes exist at this time
  REQUIRE(world.finish_frame() == Status::ok);
  REQUIRE(!world.report().lost.empty());
  const auto left = static_cast<std::uint32_t>(3 - world.report().lost.size());
  world.fail_thread_creation();
  REQUIRE(world.advance() == Status::ok);
  CHECK(refused(world, Status::no_thread) == 1);
  CHECK(world.nodes() <= std::max(1u, left));
  CHECK(world.report().accepted == world.report().candidates);
}

}  // namespace
}  // namespace ringfence::test
