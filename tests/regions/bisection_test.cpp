#include "regions/bisection.hpp"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <random>
#include <string>
#include <vector>

#include <doctest/doctest.h>

#include "regions/region_map.hpp"
#include "ringfence/error.hpp"

namespace ringfence::regions {
namespace {

/// The cells of a node: their number, their weight, and the box around them.
struct Region {
  std::uint32_t lower[3] = {~0u, ~0u, ~0u};
  std::uint32_t upper[3] = {0, 0, 0};
  std::size_t cells = 0;
  double weight = 0;
  std::size_t box_cells() const {
    std::size_t volume = 1;
    for (int axis = 0; axis < 3; ++axis) {
      volume *= upper[axis] - lower[axis] + 1;
    }
    return volume;
  }
};

std::vector<NodeNumber> bisect(const CellGrid& grid, std::uint32_t nodes, const std::vector<double>& weights) {
  Bisection bisection(grid);
  const auto owners = bisection.split(nodes, weights);
  return {owners.begin(), owners.end()};
}

std::vector<Region> regions_of(const CellGrid& grid, std::uint32_t nodes, const std::vector<NodeNumber>& owners,
                               const std::vector<double>& weights) {
  REQUIRE(owners.size() == grid.cells());
  std::vector<Region> regions(nodes);
  for (std::uint32_t z = 0; z < grid.along(2); ++z) {
    for (std::uint32_t y = 0; y < grid.along(1); ++y) {
      for (std::uint32_t x = 0; x < grid.along(0); ++x) {
        const std::uint32_t cell = grid.index(x, y, z);
        REQUIRE(owners[cell] < nodes);
        Region& region = regions[owners[cell]];
        const std::uint32_t at[3] = {x, y, z};
        for (int axis = 0; axis < 3; ++axis) {
          region.lower[axis] = std::min(region.lower[axis], at[axis]);
          region.upper[axis] = std::max(region.upper[axis], at[axis]);
        }
        ++region.cells;
        region.weight += weights.empty() ? 1.0 : weights[cell];
      }
    }
  }
  return regions;
}

std::string words(const CellGrid& grid) {
  return std::to_string(grid.log2[0]) + " " + std::to_string(grid.log2[1]) + " " + std::to_string(grid.log2[2]);
}

const std::vector<CellGrid> grids = {{{0, 0, 0}}, {{1, 0, 0}}, {{0, 3, 0}}, {{0, 0, 6}}, {{1, 1, 1}}, {{2, 1, 0}},
                                     {{3, 0, 2}}, {{2, 2, 2}}, {{5, 0, 1}}, {{3, 3, 2}}, {{0, 5, 3}}, {{3, 3, 3}}};

TEST_CASE("for every node count, each node gets its share of cells, within one cell for each level of cuts") {
  for (const CellGrid& grid : grids) {
    for (std::uint32_t nodes = 1; nodes <= grid.cells(); ++nodes) {
      CAPTURE(words(grid));
      CAPTURE(nodes);
      const auto owners = bisect(grid, nodes, {});
      const auto regions = regions_of(grid, nodes, owners, {});
      const double share = static_cast<double>(grid.cells()) / nodes;
      REQUIRE(std::all_of(regions.begin(), regions.end(), [&](const Region& region) {
        return region.cells > 0 && std::abs(static_cast<double>(region.cells) - share) <= 1.0;
      }));
    }
  }
}

TEST_CASE("1 to 1024 nodes divide 4096 cells evenly, in regions as compact as stepped boxes") {
  const CellGrid grid{{4, 4, 4}};
  for (std::uint32_t nodes = 1; nodes <= 1024; ++nodes) {
    CAPTURE(nodes);
    const auto regions = regions_of(grid, nodes, bisect(grid, nodes, {}), {});
    const double share = static_cast<double>(grid.cells()) / nodes;
    for (const Region& region : regions) {
      REQUIRE(std::abs(static_cast<double>(region.cells) - share) <= 1.0);
      // The box of a region has at most the volume of a cube with this side. Twice the side of a cube of `share` cells
      // allows for boxes that are not cubes; the steps of the cuts add one layer of cells on each side.
      const double side = std::pow(share, 1.0 / 3.0) * 2 + 2;
      REQUIRE(static_cast<double>(region.box_cells()) <= side * side * side);
    }
    if ((nodes & (nodes - 1)) == 0) {
      REQUIRE(std::all_of(regions.begin(), regions.end(),
                          [&](const Region& region) { return region.cells == grid.cells() / nodes; }));
    }
  }
}

TEST_CASE("the weights of two nodes differ by at most the heaviest cell") {
  constexpr unsigned seed = 4711;
  CAPTURE(seed);
  std::mt19937_64 random(seed);
  std::uniform_real_distribution<double> uniform(0, 1);
  for (const CellGrid& grid : grids) {
    if (grid.cells() < 2) {
      continue;
    }
    for (int round = 0; round < 20; ++round) {
      CAPTURE(words(grid));
      CAPTURE(round);
      std::vector<double> weights(grid.cells());
      for (double& weight : weights) {
        weight = round % 3 == 0 ? std::pow(uniform(random), 8.0) : uniform(random);
      }
      const auto regions = regions_of(grid, 2, bisect(grid, 2, weights), weights);
      const double heaviest = *std::max_element(weights.begin(), weights.end());
      CHECK(std::abs(regions[0].weight - regions[1].weight) <= heaviest * (1 + 1e-9));
    }
  }
}

TEST_CASE("uneven weights give uneven numbers of cells, and every node has at least one") {
  constexpr unsigned seed = 99;
  CAPTURE(seed);
  std::mt19937_64 random(seed);
  const CellGrid grid{{3, 3, 3}};
  for (const std::uint32_t nodes : {2u, 3u, 5u, 7u, 16u, 31u, 100u, 511u, 512u}) {
    for (int kind = 0; kind < 4; ++kind) {
      CAPTURE(nodes);
      CAPTURE(kind);
      std::vector<double> weights(grid.cells(), 0.0);
      if (kind == 1) {
        weights[random() % weights.size()] = 1000;  // all weight in one cell
      } else if (kind == 2) {
        for (double& weight : weights) weight = static_cast<double>(random() % 1000) * 1e-3;
      } else if (kind == 3) {
        for (std::size_t cell = 0; cell < 64; ++cell) weights[cell] = 1;  // all weight in the lowest layer
      }
      const auto regions = regions_of(grid, nodes, bisect(grid, nodes, weights), weights);
      REQUIRE(std::all_of(regions.begin(), regions.end(), [](const Region& region) { return region.cells > 0; }));
      if (kind == 3 && nodes <= 16) {
        const double heaviest = std::max_element(regions.begin(), regions.end(), [](const Region& p, const Region& q) {
                                  return p.weight < q.weight;
                                })->weight;
        CHECK(heaviest <= 64.0 / nodes + 1.0);
      }
    }
  }
}

TEST_CASE("if all weights are zero, the cells are divided by volume") {
  const CellGrid grid{{3, 2, 2}};
  for (std::uint32_t nodes = 1; nodes <= grid.cells(); ++nodes) {
    CAPTURE(nodes);
    const std::vector<double> none(grid.cells(), 0.0);
    CHECK((bisect(grid, nodes, none) == bisect(grid, nodes, {})));
  }
}

TEST_CASE("more nodes than cells, and zero nodes, are refused with a message that names the setting") {
  for (const CellGrid& grid : grids) {
    CHECK_NOTHROW(RegionMap(grid, static_cast<std::uint32_t>(grid.cells())));
    CHECK_THROWS_AS(RegionMap(grid, static_cast<std::uint32_t>(grid.cells() + 1)), Error);
    CHECK_THROWS_WITH_AS(RegionMap(grid, 0), doctest::Contains("WorldConfig::nodes"), Error);
  }
}

TEST_CASE("CellGrid::choose returns the requested number of nearly cubic cells, at most 1024 on an axis") {
  constexpr unsigned seed = 5;
  CAPTURE(seed);
  std::mt19937_64 random(seed);
  std::uniform_real_distribution<double> exponent(0, 7);
  for (int round = 0; round < 300; ++round) {
    CAPTURE(round);
    const double extents[3] = {std::pow(10, exponent(random)), std::pow(10, exponent(random)),
                               std::pow(10, exponent(random))};
    const std::size_t cells = std::size_t{1} << random() % 17;
    const CellGrid grid = CellGrid::choose(extents, cells);
    CHECK(grid.cells() == cells);
    double shortest = 1e300, longest = 0;
    for (std::size_t axis = 0; axis < 3; ++axis) {
      CHECK(grid.log2[axis] <= 10);
      const double side = extents[axis] / grid.along(axis);
      longest = std::max(longest, side);
      if (grid.log2[axis] > 0) {
        shortest = std::min(shortest, side);
      }
    }
    const bool capped = grid.log2[0] == 10 || grid.log2[1] == 10 || grid.log2[2] == 10;
    if (cells > 1 && !capped) {
      CHECK(longest <= 2.0 * shortest * (1 + 1e-12));
    }
  }
  const double cube[3] = {1, 1, 1};
  CHECK(CellGrid::choose(cube, std::size_t{1} << 40).cells() == std::size_t{1} << 30);
  const CellGrid even = CellGrid::choose(cube, 4096);
  CHECK((even.log2[0] == 4 && even.log2[1] == 4 && even.log2[2] == 4));
}

}  // namespace
}  // namespace ringfence::regions
