#include "regions/balance.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <numeric>
#include <random>
#include <vector>

#include <doctest/doctest.h>

namespace ringfence::regions {
namespace {

using geometry::Bounds;

struct Crowd {
  std::vector<Bounds> boxes;
  std::vector<std::array<std::uint32_t, 3>> points;
};

/// Adds `count` boxes of side `extent`, with lower corners from `at` to `at` + `spread` on each axis, in fixed-point
/// steps.
void add_crowd(Crowd& crowd, std::size_t count, std::uint32_t at, std::uint32_t spread, std::uint32_t extent,
               std::mt19937_64& random) {
  for (std::size_t i = 0; i < count; ++i) {
    Bounds box;
    std::array<std::uint32_t, 3> point;
    for (std::size_t axis = 0; axis < 3; ++axis) {
      box.lower[axis] = at + static_cast<std::uint32_t>(random() % spread);
      box.upper[axis] = box.lower[axis] + extent;
      point[axis] = box.lower[axis] + extent / 2;
    }
    crowd.boxes.push_back(box);
    crowd.points.push_back(point);
  }
}

void weigh(Balance& balance, const Crowd& crowd) {
  balance.begin_weights();
  for (std::size_t i = 0; i < crowd.boxes.size(); ++i) {
    const std::uint32_t point[3] = {crowd.points[i][0], crowd.points[i][1], crowd.points[i][2]};
    balance.add_object_weight(point);
    balance.add_object_size(crowd.boxes[i]);
  }
}

/// The cost of each node in milliseconds, if an object costs `each`.
std::vector<NodeCost> costs_of(const RegionMap& map, const Crowd& crowd, const std::vector<NodeNumber>& nodes,
                               double each = 0.001) {
  std::vector<double> by_owner(map.nodes(), 0.0);
  for (const auto& point : crowd.points) by_owner[map.owner_at(point.data())] += each;
  std::vector<NodeCost> costs;
  for (const NodeNumber node : nodes) costs.push_back({node, by_owner[node]});
  return costs;
}

std::vector<NodeNumber> first_nodes(std::uint32_t count) {
  std::vector<NodeNumber> nodes(count);
  std::iota(nodes.begin(), nodes.end(), 0u);
  return nodes;
}

double imbalance_of(const RegionMap& map, const Crowd& crowd, const std::vector<NodeNumber>& nodes) {
  double most = 0, sum = 0;
  for (const NodeCost& cost : costs_of(map, crowd, nodes)) {
    most = std::max(most, cost.ms);
    sum += cost.ms;
  }
  return most * static_cast<double>(nodes.size()) / sum;
}
double imbalance_of(const RegionMap& map, const Crowd& crowd) {
  return imbalance_of(map, crowd, first_nodes(map.nodes()));
}

/// Runs `frames` frames. Returns the number of map changes.
int run_frames(Balance& balance, RegionMap& map, const Crowd& crowd, const std::vector<NodeNumber>& nodes, int frames,
               double each = 0.001) {
  int changes = 0;
  for (int frame = 0; frame < frames; ++frame) {
    balance.add_frame(costs_of(map, crowd, nodes, each));
    if (!balance.needs_new_map()) continue;
    weigh(balance, crowd);
    balance.refine(map, static_cast<std::uint32_t>(nodes.size()));
    if (const auto table = balance.propose(map, nodes, crowd.points.size()); !table.empty()) {
      map.assign(table, map.nodes(), map.epoch() + 1);
      ++changes;
    }
  }
  return changes;
}
int run_frames(Balance& balance, RegionMap& map, const Crowd& crowd, int frames, double each = 0.001) {
  return run_frames(balance, map, crowd, first_nodes(map.nodes()), frames, each);
}

TEST_CASE("a crowd in a single cell is divided among all nodes, and so are two crowds far apart") {
  for (const std::uint32_t nodes : {2u, 3u, 8u, 16u, 64u}) {
    CAPTURE(nodes);
    std::mt19937_64 random(nodes);
    const CellGrid grid{{4, 4, 4}};
    Crowd crowd;
    add_crowd(crowd, 6000, 0x51234567, 1u << 17, 1u << 8, random);  // the side of a cell is 2^28
    if (nodes % 2 == 0 && nodes > 2) add_crowd(crowd, 6000, 0xe0000000, 1u << 20, 1u << 8, random);
    RegionMap map(grid, nodes);
    Balance balance(grid, {}, 100);
    CHECK(imbalance_of(map, crowd) > 0.45 * nodes);
    CHECK(run_frames(balance, map, crowd, 100) >= 1);
    CHECK(map.has_cuts());
    CHECK(imbalance_of(map, crowd) < 1.15);
  }
}

TEST_CASE("slots without a node own nothing, and the others share the load") {
  const CellGrid grid{{4, 4, 4}};
  std::mt19937_64 random(11);
  Crowd crowd;
  add_crowd(crowd, 6000, 0x51234567, 1u << 28, 1u << 8, random);
  const std::vector<NodeNumber> nodes{1, 2, 6};
  Balance balance(grid, {}, 100);
  RegionMap map(grid, 8);
  weigh(balance, crowd);
  balance.refine(map, 3);
  map.assign(balance.partition_for(nodes), 8, map.epoch() + 1);
  const auto owns_only_nodes = [&] {
    bool all = true;
    for (std::size_t word = 0; word < map.table().size(); ++word) {
      const std::uint32_t entry = map.table()[word];
      all &= RegionMap::is_plane(word, grid) || RegionMap::is_cut(entry) ||
             std::count(nodes.begin(), nodes.end(), entry) == 1;
    }
    return all;
  };
  CHECK(owns_only_nodes());
  CHECK(imbalance_of(map, crowd, nodes) < 1.15);
  CHECK(map.sole_owner() == RegionMap::many_owners);
  // From a skewed map the load becomes even again.
  std::vector<std::uint32_t> skewed(grid.cells(), 6);
  skewed[0] = 1;
  skewed[1] = 2;
  map.assign(skewed, 8, map.epoch() + 1);
  CHECK(run_frames(balance, map, crowd, nodes, 100) >= 1);
  CHECK(owns_only_nodes());
  CHECK(imbalance_of(map, crowd, nodes) < 1.15);
}

TEST_CASE("objects at one point do not cause endless cuts, and objects larger than a cell cause none") {
  const CellGrid grid{{2, 2, 2}};
  std::mt19937_64 random(3);
  for (const std::uint32_t extent : {0u, 1u << 31}) {
    Crowd crowd;
    add_crowd(crowd, 500, 0x12345678, 1, extent, random);
    RegionMap map(grid, 8);
    Balance balance(grid, {}, 0);
    run_frames(balance, map, crowd, 100);
    CHECK(map.table().size() <= grid.cells() + RegionMap::words_of_cut * Refinement::max_cuts);
    if (extent != 0) CHECK_FALSE(map.has_cuts());
    for (const NodeNumber node : {0u, 7u}) {
      bool owns = false;
      map.visit_owners({{0, 0, 0}, {~0u, ~0u, ~0u}}, [&](NodeNumber owner) { return !(owns = owner == node); });
      CHECK(owns);
    }
  }
}

TEST_CASE("the map does not change if the load is even, or if the gain is less than the cost of the hand-overs") {
  const CellGrid grid{{4, 4, 4}};
  std::mt19937_64 random(5);
  Crowd crowd;
  add_crowd(crowd, 20000, 0, 0xf0000000, 1u << 20, random);
  RegionMap map(grid, 4);
  Balance balance(grid, {}, 0);
  run_frames(balance, map, crowd, 200);
  CHECK(imbalance_of(map, crowd) < 1.1);
  CHECK(run_frames(balance, map, crowd, 200) == 0);
  // The same skew, first with objects that cost little, then with objects that cost much.
  add_crowd(crowd, 8000, 0x20000000, 1u << 26, 1u << 20, random);
  RegionMap cheap = map;
  Balance other(grid, {}, 0);
  CHECK(run_frames(other, cheap, crowd, 200, 1e-7) == 0);
  CHECK(run_frames(balance, map, crowd, 200) >= 1);
  CHECK(imbalance_of(map, crowd) < 1.15);
}

TEST_CASE("leaves tile the world, their weights add up, and none is heavier than the limit") {
  std::mt19937_64 random(6);
  const CellGrid grid{{1, 3, 2}};
  std::vector<Weight> weights;
  for (int i = 0; i < 5000; ++i) {
    const unsigned shift = static_cast<unsigned>(random() % 20);
    Weight weight{{}, 1 + static_cast<float>(random() % 3)};
    for (std::uint32_t& each : weight.point) each = static_cast<std::uint32_t>(random() % (1ull << 32)) >> shift;
    weights.push_back(weight);
  }
  Refinement refinement(grid);
  const std::uint32_t smallest[3] = {1, 16, 1u << 12};
  refinement.refine(weights, 40, smallest);
  double volume = 0, total = 0, expected = 0;
  for (const Leaf& leaf : refinement.leaves()) {
    const geometry::Bounds& part = leaf.bounds;
    const auto side = [&](std::size_t axis) { return std::uint64_t{part.upper[axis]} - part.lower[axis] + 1; };
    volume +=
        static_cast<double>(side(0)) * static_cast<double>(side(1)) * std::ldexp(static_cast<double>(side(2)), -96);
    total += leaf.weight;
    double inside = 0;
    for (const Weight& each : weights) {
      bool in = true;
      for (std::size_t axis = 0; axis < 3; ++axis) {
        in &= each.point[axis] >= part.lower[axis] && each.point[axis] <= part.upper[axis];
      }
      inside += in ? static_cast<double>(each.weight) : 0;
    }
    REQUIRE(inside == leaf.weight);
    bool small = true;
    for (std::size_t axis = 0; axis < 3; ++axis) {
      REQUIRE(side(axis) >= std::min<std::uint64_t>(smallest[axis], 1ull << (32 - grid.log2[axis])));
      small &= side(axis) < 2 * std::uint64_t{smallest[axis]};
    }
    REQUIRE((leaf.weight <= 40 || small));
  }
  for (const Weight& each : weights) expected += static_cast<double>(each.weight);
  CHECK(volume == doctest::Approx(1));
  CHECK(total == doctest::Approx(expected));
  CHECK(refinement.leaves().size() > grid.cells());
  std::vector<NodeNumber> owners(refinement.leaves().size());
  std::iota(owners.begin(), owners.end(), 0u);
  RegionMap map(grid, 1);
  const auto check_owners = [&] {
    const auto nodes = static_cast<std::uint32_t>(owners.size());
    REQUIRE(RegionMap::is_table(refinement.table(owners), grid, nodes));
    map.assign(refinement.table(owners), nodes, 2);
    for (std::size_t i = 0; i < owners.size(); ++i) {
      REQUIRE(map.owner_at(refinement.leaves()[i].bounds.lower) == owners[i]);
      REQUIRE(map.owner_at(refinement.leaves()[i].bounds.upper) == owners[i]);
    }
  };
  check_owners();
  // Parts with the same owner are one part.
  const std::size_t words = map.table().size();
  for (NodeNumber& owner : owners) owner /= 16;
  check_owners();
  CHECK(map.table().size() < words / 2);
  owners.assign(owners.size(), 1);
  check_owners();
  CHECK_FALSE(map.has_cuts());
}

TEST_CASE("a crowd in a cell that is 10^6 times as wide takes few cuts") {
  std::mt19937_64 random(7);
  const CellGrid grid{{2, 2, 2}};
  for (const std::uint32_t corner : {5u, 0x7ffff000u, 0xffffe000u}) {
    CAPTURE(corner);
    std::vector<Weight> weights(4000, {{}, 1});
    for (Weight& each : weights) {
      for (std::uint32_t& at : each.point) at = corner + static_cast<std::uint32_t>(random() % 1024);
    }
    Refinement refinement(grid);
    const std::uint32_t smallest[3] = {8, 8, 8};
    refinement.refine(weights, 2000, smallest);
    CHECK(refinement.leaves().size() - grid.cells() <= 8);  // two on each axis, and one or two through the crowd
    double heaviest = 0;
    for (const Leaf& leaf : refinement.leaves()) heaviest = std::max(heaviest, leaf.weight);
    CHECK(heaviest <= 2000);
  }
}

TEST_CASE("no object of a lattice in one cell is on both sides of a cut") {
  const CellGrid grid{{2, 2, 2}};
  for (const std::uint32_t row : {6u, 7u, 15u}) {
    CAPTURE(row);
    constexpr std::uint32_t corner = 0x90000000u, step = 300, radius = 100;
    std::vector<Weight> weights;
    for (std::uint32_t i = 0; i < row * row * row; ++i) {
      weights.push_back(
          {{corner + step * (i % row), corner + step * (i / row % row), corner + step * (i / row / row)}, 1});
    }
    Refinement refinement(grid);
    const std::uint32_t smallest[3] = {2 * radius, 2 * radius, 2 * radius};
    refinement.refine(weights, static_cast<double>(weights.size()) / 3, smallest);
    REQUIRE(refinement.leaves().size() > grid.cells() + 2);
    for (const Leaf& leaf : refinement.leaves()) {
      for (const Weight& each : weights) {
        for (std::size_t axis = 0; axis < 3; ++axis) {
          const std::uint32_t at = each.point[axis], below = leaf.bounds.lower[axis], above = leaf.bounds.upper[axis];
          REQUIRE((at + radius < below || at - radius >= below));
          REQUIRE((at - radius > above || at + radius <= above));
        }
      }
    }
  }
}

}  // namespace
}  // namespace ringfence::regions
