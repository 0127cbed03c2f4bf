#include "nodes/server/frame/map_scheduler.hpp"

#include <algorithm>

#include <doctest/doctest.h>

#include "nodes/server/server_fixture.hpp"

namespace ringfence::nodes::test {
namespace {

struct Scheduler {
  explicit Scheduler(const FixtureConfig& config) : fixture(config) {}
  ServerState& state() { return fixture.state(); }
  /// The largest number of objects whose positions one node owns.
  std::ptrdiff_t most_owned() {
    std::vector<std::ptrdiff_t> owned(state().nodes.size());
    for (const ObjectRow& row : state().objects.rows()) {
      ++owned[state().owner_at(row.pose.position)];
    }
    return *std::max_element(owned.begin(), owned.end());
  }
  bool owns(NodeNumber node) { return std::count(state().map.table().begin(), state().map.table().end(), node) != 0; }

  ServerFixture fixture;
  ObjectStates states{fixture.state(), fixture.exchange()};
  MapScheduler scheduler{fixture.state(), fixture.exchange(), states};
};

TEST_CASE("a partition gives the cells of nodes that leave to those that stay, in the next map") {
  Scheduler test({.nodes = 3});
  test.state().nodes[1].leaving = true;
  const std::uint32_t epoch = test.state().map.epoch();
  test.scheduler.request_partition();
  test.scheduler.change_map();
  CHECK(test.state().map.epoch() == epoch + 1);
  CHECK(test.state().map_change.at_end);
  CHECK(!test.owns(1));
  CHECK(test.owns(0));
  CHECK(test.owns(2));
  CHECK(test.state().nodes[1].left);
  CHECK(!test.state().nodes[1].leaving);
  CHECK(!test.state().nodes[0].left);
}

TEST_CASE("if all nodes would leave, all stay") {
  Scheduler test({.nodes = 2});
  for (PeerSession& node : test.state().nodes) node.leaving = true;
  test.scheduler.request_partition();
  test.scheduler.change_map();
  CHECK(test.owns(0));
  CHECK(test.owns(1));
  CHECK(!test.state().nodes[0].left);
  CHECK(!test.state().nodes[1].left);
}

TEST_CASE("a frame with a loss changes no map, and a partition waits for the first frame without") {
  Scheduler test({.nodes = 3});
  const std::uint32_t epoch = test.state().map.epoch();
  test.state().report().lost.emplace_back(2u);
  test.state().nodes[1].leaving = true;
  test.scheduler.request_partition();
  test.scheduler.change_map();
  CHECK(test.state().map.epoch() == epoch);
  CHECK(!test.state().nodes[1].leaving);  // the facade decides again
  test.state().report().lost.clear();
  test.scheduler.change_map();
  CHECK(test.state().map.epoch() == epoch + 1);
}

TEST_CASE("the regions follow the load, whether the nodes share memory or not") {
  for (const bool shares : {false, true}) {
    CAPTURE(shares);
    Scheduler test({.nodes = 2, .placement = Placement::region, .shares_memory = shares});
    for (int i = 0; i < 16; ++i) {
      test.fixture.add({1.5 + i, 1.5 + i, 4}, Endpoint::node(0));
    }
    REQUIRE(test.most_owned() == 16);
    const std::uint32_t epoch = test.state().map.epoch();
    int frames = 0;
    for (; frames < 100 && test.state().map.epoch() == epoch; ++frames) {
      test.state().nodes[0].cost_ms = 10;
      test.state().nodes[1].cost_ms = 1;
      test.scheduler.plan();
      test.scheduler.change_map();
    }
    REQUIRE(test.state().map.epoch() == epoch + 1);
    CHECK(test.most_owned() < 12);
    CHECK(frames > 16);  // costs are summed over a window first
    CHECK(test.state().map_change.hosts_exchange_objects);
  }
}

/// Lets the nodes of a crowd in the region of node 0 cost unequally for `frames` frames, or until the map changes.
/// Returns the number of frames.
int plan_frames(Scheduler& test, int frames) {
  const std::uint32_t epoch = test.state().map.epoch();
  for (int frame = 0; frame < frames; ++frame) {
    for (PeerSession& node : test.state().nodes) node.cost_ms = node.self.number() == 0 ? 10 : 1;
    test.scheduler.plan();
    test.scheduler.change_map();
    if (test.state().map.epoch() != epoch) return frame + 1;
  }
  return frames;
}

TEST_CASE("a new map is adopted a fixed number of frames after the costs differ, however long it takes to compute") {
  int first = 0;
  for (int round = 0; round < 3; ++round) {
    Scheduler test({.nodes = 2, .placement = Placement::region});
    for (int i = 0; i < 16; ++i) test.fixture.add({1.5 + i, 1.5 + i, 4}, Endpoint::node(0));
    const int frames = plan_frames(test, 100);
    CHECK(frames < 100);
    if (round == 0) first = frames;
    CHECK(frames == first);
    // The costs of a new map are summed over a window of their own.
    CHECK(plan_frames(test, 16) == 16);
  }
}

TEST_CASE("a plan ends when nodes leave or are lost meanwhile, at any of its frames") {
  for (int frame = 32; frame < 40; ++frame) {
    CAPTURE(frame);
    for (const bool leaves : {false, true}) {
      Scheduler test({.nodes = 3, .placement = Placement::region});
      for (int i = 0; i < 16; ++i) test.fixture.add({1.5 + i, 1.5 + i, 4}, Endpoint::node(0));
      plan_frames(test, frame);
      const std::uint32_t epoch = test.state().map.epoch();
      if (leaves) {
        test.state().nodes[2].leaving = true;
        test.scheduler.request_partition();
        test.scheduler.change_map();
        CHECK(!test.owns(2));
      } else {
        const regions::RegionMap map(test.state().map.grid(), 2);
        test.state().map.assign(map.table(), 3, epoch + 1);  // as a cut does
      }
      CHECK(test.state().map.epoch() == epoch + 1);
      plan_frames(test, 1);
      CHECK(test.state().map.epoch() == epoch + 1);
    }
  }
}

TEST_CASE("the map stays while the nodes cost the same, and while the cost of one is not known") {
  Scheduler test({.nodes = 2});
  test.fixture.add({1, 1, 1}, Endpoint::node(0));
  for (const double first : {1.0, PeerSession::no_cost}) {
    for (int frame = 0; frame < 100; ++frame) {
      test.state().nodes[0].cost_ms = first;
      test.state().nodes[1].cost_ms = 1;
      CHECK(!test.scheduler.plan());
      test.scheduler.change_map();
    }
    CHECK(!test.state().map_change.at_end);
  }
}

TEST_CASE("if every node that stays is lost, one that leaves stays") {
  Scheduler test({.nodes = 3});
  auto& nodes = test.state().nodes;
  nodes[1].left = nodes[2].left = true;
  test.scheduler.finish();
  CHECK(nodes[1].left);
  CHECK(nodes[2].left);
  nodes[0].lost = true;
  test.scheduler.finish();
  CHECK(!nodes[1].left);
  CHECK(nodes[2].left);
}

TEST_CASE("the cost of a node is its CPU time, or proportional to the pairs that it tested") {
  NodeReport node;
  node.cpu_ms = 3;
  node.tested = 1000;
  ServerSetup setup;
  CHECK(MapScheduler::cost_of(setup, node) == 3);
  setup.balance_by = BalanceBy::pairs;
  const double once = MapScheduler::cost_of(setup, node);
  node.tested = 2000;
  CHECK(MapScheduler::cost_of(setup, node) == doctest::Approx(2 * once));
}

}  // namespace
}  // namespace ringfence::nodes::test
