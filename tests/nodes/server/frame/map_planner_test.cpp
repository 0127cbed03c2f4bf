#include "nodes/server/frame/map_planner.hpp"

#include <cstddef>
#include <cstdint>
#include <random>
#include <system_error>
#include <thread>
#include <vector>

#include <doctest/doctest.h>
#include <pthread.h>

namespace ringfence::nodes::test {
namespace {

constexpr std::uint32_t node_count = 8;
const regions::CellGrid grid{{4, 4, 4}};

/// A crowd in one corner of the world, and the costs of its nodes.
struct Crowd {
  explicit Crowd(std::uint64_t seed) {
    std::mt19937_64 random(seed);
    for (int i = 0; i < 3000; ++i) {
      std::vector<std::uint32_t> point;
      for (int axis = 0; axis < 3; ++axis) point.push_back(static_cast<std::uint32_t>(random() % (1u << 30)));
      points.push_back(point);
    }
  }
  std::vector<regions::NodeCost> costs(const regions::RegionMap& map) const {
    std::vector<regions::NodeCost> costs;
    for (NodeNumber node = 0; node < node_count; ++node) costs.push_back({node, 0});
    for (const auto& point : points) costs[map.owner_at(point.data())].ms += 0.01;
    return costs;
  }
  void weigh(regions::Balance& balance, const regions::RegionMap& map) const {
    for (int frame = 0; frame < 40; ++frame) balance.add_frame(costs(map));
    balance.begin_weights();
    for (const auto& point : points) {
      const std::uint32_t at[3] = {point[0], point[1], point[2]};
      balance.add_object_weight(at);
      balance.add_object_size({{at[0], at[1], at[2]}, {at[0] + 100, at[1] + 100, at[2] + 100}});
    }
  }
  std::vector<std::vector<std::uint32_t>> points;
};

std::vector<NodeNumber> all_nodes() {
  std::vector<NodeNumber> nodes;
  for (NodeNumber node = 0; node < node_count; ++node) nodes.push_back(node);
  return nodes;
}

TEST_CASE("the planner computes the map that the balance proposes, while costs are added") {
  regions::Balance direct(grid, {}, 0), balance(grid, {}, 0);
  MapPlanner planner(balance);
  for (std::uint64_t seed = 1; seed <= 5; ++seed) {
    CAPTURE(seed);
    const regions::RegionMap map(grid, node_count);
    const Crowd crowd(seed);
    crowd.weigh(direct, map);
    direct.refine(map, node_count);
    const auto expected = direct.propose(map, all_nodes(), 0);
    REQUIRE(!expected.empty());

    crowd.weigh(balance, map);
    CHECK(!planner.is_started());
    planner.start({map, all_nodes(), 0});
    CHECK(planner.is_started());
    const auto costs = crowd.costs(map);
    for (int frame = 0; frame < 40; ++frame) balance.add_frame(costs);
    const auto table = planner.take();
    CHECK(!planner.is_started());
    CHECK(std::vector(table.begin(), table.end()) == std::vector(expected.begin(), expected.end()));
  }
}

/// While it exists, the system refuses new threads: no address space is large enough for their stacks.
class RefusedThreads {
 public:
  RefusedThreads() {
    REQUIRE(pthread_getattr_default_np(&before_) == 0);
    pthread_attr_t huge;
    REQUIRE(pthread_attr_init(&huge) == 0);
    REQUIRE(pthread_attr_setstacksize(&huge, std::size_t{1} << 60) == 0);
    REQUIRE(pthread_setattr_default_np(&huge) == 0);
    pthread_attr_destroy(&huge);
  }
  ~RefusedThreads() {
    pthread_setattr_default_np(&before_);
    pthread_attr_destroy(&before_);
  }
  RefusedThreads(const RefusedThreads&) = delete;
  RefusedThreads& operator=(const RefusedThreads&) = delete;

 private:
  pthread_attr_t before_;
};

TEST_CASE("the planner computes the same map where the system has no thread for it, and with a thread afterwards") {
  const regions::RegionMap map(grid, node_count);
  const Crowd crowd(1);
  regions::Balance direct(grid, {}, 0), balance(grid, {}, 0);
  MapPlanner planner(balance);
  for (int round = 0; round < 2; ++round) {
    CAPTURE(round);
    crowd.weigh(direct, map);
    direct.refine(map, node_count);
    const auto expected = direct.propose(map, all_nodes(), 0);
    REQUIRE(!expected.empty());

    crowd.weigh(balance, map);
    if (round == 0) {
      const RefusedThreads refused;
      CHECK_THROWS_AS(std::thread([] {}).join(), std::system_error);
      planner.start({map, all_nodes(), 0});
    } else {
      planner.start({map, all_nodes(), 0});
    }
    const auto table = planner.take();
    CHECK(std::vector(table.begin(), table.end()) == std::vector(expected.begin(), expected.end()));
  }
}

TEST_CASE("the planner returns no map if none pays off") {
  regions::Balance balance(grid, {}, 0);
  MapPlanner planner(balance);
  const regions::RegionMap map(grid, node_count);
  Crowd(1).weigh(balance, map);
  planner.start({map, all_nodes(), 1'000'000'000});
  CHECK(planner.take().empty());
}

TEST_CASE("a planner may be destroyed before a map was ordered, while it computes one, and after") {
  const regions::RegionMap map(grid, node_count);
  for (int round = 0; round < 20; ++round) {
    regions::Balance balance(grid, {}, 0);
    Crowd(1).weigh(balance, map);
    MapPlanner planner(balance);
    if (round % 3 > 0) planner.start({map, all_nodes(), 0});
    if (round % 3 > 1) planner.take();
  }
}

}  // namespace
}  // namespace ringfence::nodes::test
