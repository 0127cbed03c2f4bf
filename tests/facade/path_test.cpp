// What FrameReport::path says a frame waited for.
#include <algorithm>
#include <memory>

#include <doctest/doctest.h>

#include "facade/script.hpp"
#include "facade/swarm.hpp"
#include "ringfence/world.hpp"

namespace ringfence::test {
namespace {

TEST_CASE("of what is done at the same time the path counts the longest, of the rest all") {
  PathReport path;
  double expected = 0;
  double ms = 1;
  for (const auto& [name, step] : PathReport::all()) path.*step = ms *= 2;
  for (const double PathReport::*step :
       {&PathReport::open_ms, &PathReport::invite_ms, &PathReport::user_move_ms, &PathReport::node_publish_ms,
        &PathReport::publish_ms, &PathReport::user_look_ms, &PathReport::hear_ms, &PathReport::collect_ms,
        &PathReport::notify_ms, &PathReport::inform_ms, &PathReport::user_end_ms, &PathReport::finish_ms}) {
    expected += path.*step;
  }
  CHECK(path.critical_ms() == expected);
  std::swap(path.ingest_ms, path.user_move_ms);
  std::swap(path.dispatch_ms, path.node_publish_ms);
  CHECK(path.critical_ms() == expected);
  // Users move when they have been invited: nodes move longer than both, or not at all.
  const double users_move = path.invite_ms + path.ingest_ms;
  path.node_move_ms = users_move + 1;
  CHECK(path.critical_ms() == expected + 1);
  path.node_move_ms = users_move - 1;
  CHECK(path.critical_ms() == expected);
  path.node_detect_ms = path.publish_ms + path.user_look_ms + 1;
  CHECK(path.critical_ms() == ++expected);
  path.node_end_ms = path.inform_ms + path.user_end_ms + 1;
  CHECK(path.critical_ms() == expected + 1);
}

TEST_CASE("the steps of the path are the CPU time of who took them, none left out") {
  constexpr double side = 12;
  constexpr unsigned seed = 5;
  CAPTURE(seed);
  for (const Deployment deployment : {Deployment::user, Deployment::user_server, Deployment::user_collision}) {
    CAPTURE(static_cast<int>(deployment));
    WorldConfig config;
    config.bounds_max = {side, side, side};
    config.interest = 3;
    config.nodes = 2;
    config.deployment = deployment;
    config.motion = std::make_shared<Bouncing>(side);
    World world(config);
    Script script(world, seed, side);
    for (int frame = 0; frame < 20; ++frame) {
      CAPTURE(frame);
      script.ask();
      REQUIRE(world.advance() == Status::ok);
      const FrameReport& report = world.report();
      const PathReport& path = report.path;
      for (const PathReport::Step& step : PathReport::all()) {
        CAPTURE(step.first);
        REQUIRE(path.*step.second >= 0);
      }
      // Between the last two looks at the clock the server does next to nothing.
      const double server = path.open_ms + path.invite_ms + path.ingest_ms + path.dispatch_ms + path.publish_ms +
                            path.hear_ms + path.collect_ms + path.notify_ms + path.inform_ms + path.finish_ms;
      REQUIRE(server <= report.server_cpu_ms + 1e-6);
      REQUIRE(server >= report.server_cpu_ms - 0.5);
      double busiest = 0, all = 0;
      for (const NodeReport& node : report.nodes) {
        busiest = std::max(busiest, node.cpu_ms);
        all += node.cpu_ms;
      }
      const double nodes = path.node_move_ms + path.node_publish_ms + path.node_detect_ms + path.node_end_ms;
      REQUIRE(nodes >= busiest - 1e-6);
      REQUIRE(nodes <= all + 1e-6);
      const double users = path.user_move_ms + path.user_look_ms + path.user_end_ms;
      REQUIRE(users >= report.slowest_user_cpu_ms - 1e-6);
      REQUIRE(users <= report.users_cpu_ms + 1e-6);
    }
  }
}

TEST_CASE("one thread has no path") {
  WorldConfig config;
  config.bounds_max = {9, 9, 9};
  config.nodes = 0;
  World world(config);
  REQUIRE(world.advance() == Status::ok);
  CHECK(world.report().path.critical_ms() == 0);
}

}  // namespace
}  // namespace ringfence::test
