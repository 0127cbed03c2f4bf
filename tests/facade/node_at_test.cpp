#include <map>
#include <memory>

#include <doctest/doctest.h>

#include "facade/bouncing_world.hpp"
#include "facade/checks.hpp"
#include "ringfence/world.hpp"

namespace ringfence::test {
namespace {

constexpr double side = 14;

// In user-collision deployment a node hosts the movable objects whose positions lie in its region.
void require_hosts_as_regions(const World& world) {
  std::map<NodeId, std::uint64_t> expected;
  for (const ObjectView& view : world.objects()) {
    const auto node = world.node_at(view.spec.pose.position);
    REQUIRE(node.has_value());
    const Category category = view.spec.category;
    if (category == Category::active || category == Category::non_active) ++expected[*node];
  }
  for (const NodeReport& node : world.report().nodes) REQUIRE(node.hosted == expected[node.id]);
}

}  // namespace

TEST_CASE("node_at names the node that hosts the objects of a region, also after the number of nodes has changed") {
  WorldConfig config;
  config.bounds_max = {side, side, side};
  config.nodes = 2;
  config.balance_by = BalanceBy::pairs;
  config.motion = std::make_shared<BouncingModel>(side);
  World world(config);
  CHECK(world.node_at({1, 1, 1}).has_value());
  populate(world, 300, 6, side);
  for (const std::uint32_t nodes : {2u, 5u, 3u}) {
    REQUIRE(world.resize(nodes) == Status::ok);
    for (int frame = 0; frame < 12; ++frame) {
      REQUIRE(world.advance() == Status::ok);
      if (frame > 1) require_hosts_as_regions(world);
    }
  }
}

TEST_CASE("node_at is empty while a frame is running") {
  WorldConfig config;
  config.nodes = 1;
  World world(config);
  REQUIRE(world.begin_frame() == Status::ok);
  CHECK(!world.node_at({}).has_value());
  REQUIRE(world.finish_frame() == Status::ok);
  CHECK(world.node_at({}) == NodeId(0));
}

}  // namespace ringfence::test
