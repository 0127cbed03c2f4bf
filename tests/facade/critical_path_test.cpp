// FrameReport::path: the critical path of a frame.
#include <algorithm>
#include <memory>
#include <utility>

#include <doctest/doctest.h>

#include "facade/bouncing_world.hpp"
#include "facade/script.hpp"
#include "ringfence/world.hpp"

namespace ringfence::test {
namespace {

TEST_CASE("the critical path counts the longest of concurrent steps and the sum of the others") {
  PathReport path;
  path.start_nodes_ms = 1, path.start_users_ms = 2, path.ingest_ms = 4, path.user_move_ms = 8;
  path.dispatch_ms = 16, path.node_publish_ms = 32, path.publish_ms = 64, path.user_read_ms = 128;
  path.receive_contacts_ms = 256, path.collect_ms = 512, path.notify_ms = 1024;
  path.notify_users_ms = 2048, path.user_end_ms = 4096, path.receive_user_acks_ms = 8192, path.finish_ms = 16384;
  double expected = 32767 - 4 - 16 - 2048;
  CHECK(path.critical_ms() == expected);
  path.plan_map_ms = 127;
  std::swap(path.ingest_ms, path.user_move_ms);
  std::swap(path.dispatch_ms, path.node_publish_ms);
  std::swap(path.notify_users_ms, path.user_end_ms);
  std::swap(path.user_read_ms, path.plan_map_ms);
  CHECK(path.critical_ms() == expected);
  // Nodes take longer than the concurrent steps of server and users, the same time, or none.
  const std::pair<double PathReport::*, double> concurrent[] = {
      {&PathReport::nodes_moved_ms, 1 + 2 + 8},
      {&PathReport::nodes_tested_ms, 32 + 64 + 128},
      {&PathReport::nodes_ended_ms, 1024 + 4096 + 8192},
  };
  for (const auto& [nodes, others] : concurrent) {
    path.*nodes = others;
    CHECK(path.critical_ms() == expected);
    path.*nodes = others + 1;
    CHECK(path.critical_ms() == ++expected);
  }
  // Times of single node steps are contained in the combined times.
  path.node_move_ms = path.node_detect_ms = path.node_end_ms = 1e6;
  CHECK(path.critical_ms() == expected);
}

TEST_CASE("the steps of the path add up to the CPU time of their threads") {
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
    config.motion = std::make_shared<BouncingModel>(side);
    World world(config);
    Script script(world, seed, side);
    for (int frame = 0; frame < 20; ++frame) {
      CAPTURE(frame);
      script.make_requests();
      REQUIRE(world.advance() == Status::ok);
      const FrameReport& report = world.report();
      const PathReport& path = report.path;
      for (const PathReport::Step& step : PathReport::all()) {
        CAPTURE(step.first);
        REQUIRE(path.*step.second >= 0);
      }
      // Between the last two clock readings the server does next to nothing.
      const double server = path.start_nodes_ms + path.start_users_ms + path.ingest_ms + path.dispatch_ms +
                            path.publish_ms + path.plan_map_ms + path.receive_contacts_ms + path.collect_ms +
                            path.notify_ms + path.notify_users_ms + path.receive_user_acks_ms + path.finish_ms;
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
      // The node that finishes last took at most the sum of the slowest nodes of each step, and at least its own.
      const std::pair<double, double> node_steps[] = {
          {path.nodes_moved_ms - path.node_move_ms, path.start_nodes_ms},
          {path.nodes_tested_ms - path.node_detect_ms, std::max(path.dispatch_ms, path.node_publish_ms)},
          {path.nodes_ended_ms - path.node_end_ms, path.notify_ms}};
      for (const auto& [before, most] : node_steps) {
        REQUIRE(before >= -1e-6);
        REQUIRE(before <= most + 1e-6);
      }
      const double users = path.user_move_ms + path.user_read_ms + path.user_end_ms;
      REQUIRE(users >= report.slowest_user_cpu_ms - 1e-6);
      REQUIRE(users <= report.users_cpu_ms + 1e-6);
    }
  }
}

TEST_CASE("a single thread has no critical path") {
  WorldConfig config;
  config.bounds_max = {9, 9, 9};
  config.nodes = 0;
  World world(config);
  REQUIRE(world.advance() == Status::ok);
  CHECK(world.report().path.critical_ms() == 0);
}

}  // namespace
}  // namespace ringfence::test
