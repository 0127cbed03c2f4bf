#include <algorithm>
#include <array>
#include <cmath>
#include <random>
#include <set>
#include <utility>
#include <vector>

#include <doctest/doctest.h>

#include "regions/owned_boxes.hpp"
#include "regions/recent_owners.hpp"
#include "regions/region_map.hpp"

namespace ringfence::regions {
namespace {

using geometry::Bounds;
using geometry::FixedSpace;

std::vector<std::uint32_t> random_cuts(const CellGrid& grid, std::uint32_t nodes, std::mt19937_64& random) {
  std::vector<std::uint32_t> table(grid.cells());
  std::vector<Bounds> parts;  // of each word; those of planes are not used
  for (std::uint32_t cell = 0; cell < grid.cells(); ++cell) parts.push_back(grid.bounds_of(grid.box_of(cell)));
  for (std::uint32_t& entry : table) entry = static_cast<std::uint32_t>(random() % nodes);
  for (std::uint32_t cut = 0; cut < 300; ++cut) {
    // Half of the cuts divide a part of the previous cut, so that some parts become very small.
    const std::size_t entry = cut > 0 && random() % 2 == 0 ? table.size() - 1 - random() % 2 : random() % table.size();
    const std::size_t axis = random() % 3;
    const std::uint64_t side = std::uint64_t{parts[entry].upper[axis]} - parts[entry].lower[axis];
    if (RegionMap::is_plane(entry, grid) || RegionMap::is_cut(table[entry]) || side == 0) {
      --cut;
      continue;
    }
    table[entry] = RegionMap::cut_entry(axis, cut);
    const std::uint64_t above = random() % 2 == 0 ? side / 2 : random() % side;
    const auto plane = static_cast<std::uint32_t>(parts[entry].lower[axis] + 1 + above);
    Bounds halves[2] = {parts[entry], parts[entry]};
    halves[0].upper[axis] = plane - 1;
    halves[1].lower[axis] = plane;
    table.push_back(plane);
    parts.emplace_back();
    for (const Bounds& half : halves) {
      table.push_back(static_cast<std::uint32_t>(random() % nodes));
      parts.push_back(half);
    }
  }
  REQUIRE(RegionMap::is_table(table, grid, nodes));
  return table;
}

/// A part of a map with its owner: a cell, or a part of a cell that is not cut further.
struct Part {
  std::array<std::uint64_t, 3> lower, upper;  ///< `upper` is exclusive
  NodeNumber owner;
  std::size_t cuts;  ///< above it
  bool overlaps(const Bounds& bounds) const {
    for (std::size_t axis = 0; axis < 3; ++axis) {
      if (bounds.upper[axis] < lower[axis] || bounds.lower[axis] >= upper[axis]) return false;
    }
    return true;
  }
};

void collect_parts(const RegionMap& map, std::uint32_t entry, Part part, std::vector<Part>& parts) {
  if (!RegionMap::is_cut(entry)) {
    part.owner = entry;
    parts.push_back(part);
    return;
  }
  ++part.cuts;
  const std::size_t axis = entry >> 29 & 3, words = map.grid().cells() + 3 * (entry & 0x1fffffff);
  Part below = part, above = part;
  below.upper[axis] = above.lower[axis] = map.table()[words];
  collect_parts(map, map.table()[words + 1], below, parts);
  collect_parts(map, map.table()[words + 2], above, parts);
}

std::vector<Part> parts_of(const RegionMap& map) {
  std::vector<Part> parts;
  const CellGrid& grid = map.grid();
  for (std::uint32_t cell = 0; cell < grid.cells(); ++cell) {
    Part part{};
    const CellBox box = grid.box_of(cell);
    for (std::size_t axis = 0; axis < 3; ++axis) {
      const std::uint64_t side = (std::uint64_t{1} << 32) / grid.along(axis);
      part.lower[axis] = box.lower[axis] * side;
      part.upper[axis] = part.lower[axis] + side;
    }
    collect_parts(map, map.table()[cell], part, parts);
  }
  return parts;
}

/// Runs `check` with maps of many grids and node counts.
template <class Check>
void for_each_map(unsigned seed, Check check) {
  CAPTURE(seed);
  std::mt19937_64 random(seed);
  const CellGrid grids[] = {{{0, 0, 0}}, {{1, 0, 0}}, {{4, 0, 3}}, {{2, 3, 2}}, {{10, 0, 0}}, {{4, 4, 4}}};
  for (const CellGrid& grid : grids) {
    for (const std::uint32_t requested : {1u, 2u, 3u, 7u, 16u, 100u, 1024u}) {
      const auto nodes = static_cast<std::uint32_t>(std::min<std::size_t>(requested, grid.cells()));
      CAPTURE(nodes);
      RegionMap map(grid, nodes);
      check(map, random);
      // A few cells inside regions belong to another node or are cut.
      std::vector<std::uint32_t> scattered(map.table().begin(), map.table().end());
      for (std::uint32_t cut = 0; cut < 3; ++cut) {
        scattered[random() % grid.cells()] = static_cast<std::uint32_t>(random() % nodes);
        const std::size_t cell = random() % grid.cells();
        if (scattered.size() == grid.cells()) {
          const Bounds bounds = grid.bounds_of(grid.box_of(static_cast<std::uint32_t>(cell)));
          const std::uint32_t plane = bounds.lower[0] + (bounds.upper[0] - bounds.lower[0]) / 3 + 1;
          scattered.insert(scattered.end(), {plane, scattered[cell], static_cast<std::uint32_t>(random() % nodes)});
          scattered[cell] = RegionMap::cut_entry(0, 0);
        }
      }
      map.assign(scattered, nodes, 8);
      check(map, random);
      // A map that no bisection produces: every cell has a random owner.
      std::vector<NodeNumber> owners(grid.cells());
      for (NodeNumber& owner : owners) {
        owner = static_cast<NodeNumber>(random() % nodes);
      }
      map.assign(owners, nodes, 9);
      CHECK(map.epoch() == 9);
      CHECK_FALSE(map.has_cuts());
      check(map, random);
      // Cells cut at random, some of them many times.
      map.assign(random_cuts(grid, nodes, random), nodes, 10);
      CHECK(map.has_cuts());
      check(map, random);
    }
  }
}

Bounds random_bounds(std::mt19937_64& random, unsigned size_bits) {
  Bounds bounds;
  for (int axis = 0; axis < 3; ++axis) {
    std::uint64_t lower = random() % (std::uint64_t{1} << 32);
    if (random() % 4 == 0) {
      lower &= ~((std::uint64_t{1} << 22) - 1);  // on a boundary of the finest cells
    }
    const std::uint64_t size = random() % (std::uint64_t{1} << size_bits);
    bounds.lower[axis] = static_cast<std::uint32_t>(lower);
    bounds.upper[axis] = static_cast<std::uint32_t>(std::min<std::uint64_t>(lower + size, 0xffffffffu));
  }
  return bounds;
}

TEST_CASE("the owner of a pair covers both objects, and does not depend on the order of the pair") {
  for_each_map(31, [](const RegionMap& map, std::mt19937_64& random) {
    int pairs = 0;
    for (int round = 0; round < 4000 && pairs < 300; ++round) {
      const unsigned bits = 20 + static_cast<unsigned>(random() % 12);
      const Bounds p = random_bounds(random, bits);
      Bounds q = random_bounds(random, bits);
      if (round % 3 == 0) {
        q = p;  // the upper corner of one is the lower corner of the other: they touch in a point
        for (int axis = 0; axis < 3; ++axis) {
          q.lower[axis] = p.upper[axis];
          q.upper[axis] = std::max(q.upper[axis], q.lower[axis]);
        }
      }
      if (!geometry::touch(p, q)) {
        continue;
      }
      ++pairs;
      const NodeNumber owner = map.pair_owner(p, q);
      REQUIRE(owner < map.nodes());
      REQUIRE(owner == map.pair_owner(q, p));
      REQUIRE(map.coverage(p, owner) != Coverage::none);
      REQUIRE(map.coverage(q, owner) != Coverage::none);
    }
    REQUIRE(pairs > 100);
  });
}

TEST_CASE("exactly the owners of the space that bounds cover are visited, each once") {
  for_each_map(32, [](const RegionMap& map, std::mt19937_64& random) {
    const std::vector<Part> parts = parts_of(map);
    std::vector<std::uint64_t> stamps(map.nodes(), 0);
    std::uint64_t stamp = 0;
    for (int round = 0; round < 40; ++round) {
      const Bounds bounds = random_bounds(random, 18 + static_cast<unsigned>(random() % 14));
      std::set<NodeNumber> expected;
      for (const Part& part : parts) {
        if (part.overlaps(bounds)) expected.insert(part.owner);
      }
      std::vector<NodeNumber> visited;
      for_each_owner(map, bounds, stamps, ++stamp, [&](NodeNumber node) { visited.push_back(node); });
      REQUIRE(visited.size() == expected.size());
      REQUIRE((std::set<NodeNumber>(visited.begin(), visited.end()) == expected));
      for (NodeNumber node = 0; node < std::min(map.nodes(), 20u); ++node) {
        const Coverage coverage = expected.count(node) == 0 ? Coverage::none
                                  : expected.size() == 1    ? Coverage::all
                                                            : Coverage::part;
        REQUIRE(map.coverage(bounds, node) == coverage);
      }
      // A point has one owner: that of the part that contains it.
      const Bounds point{{bounds.lower[0], bounds.lower[1], bounds.lower[2]},
                         {bounds.lower[0], bounds.lower[1], bounds.lower[2]}};
      REQUIRE(std::count_if(parts.begin(), parts.end(), [&](const Part& part) {
                return part.overlaps(point) && part.owner == map.owner_at(point.lower);
              }) == 1);
    }
  });
}

TEST_CASE("recent owners are those that the map has, however the bounds follow each other") {
  for_each_map(37, [](const RegionMap& map, std::mt19937_64& random) {
    RecentOwners recent;
    Bounds bounds{};
    for (int round = 0; round < 400; ++round) {
      if (round % 10 == 0) {
        bounds = random_bounds(random, 18 + static_cast<unsigned>(random() % 14));
      }
      const unsigned step_bits = static_cast<unsigned>(random() % 28);
      for (int axis = 0; axis < 3; ++axis) {  // wraps around, so the corners have to be ordered again
        bounds.lower[axis] += static_cast<std::uint32_t>(random() % (1u << step_bits));
        bounds.upper[axis] += static_cast<std::uint32_t>(random() % (1u << step_bits));
        if (bounds.lower[axis] > bounds.upper[axis]) std::swap(bounds.lower[axis], bounds.upper[axis]);
      }
      std::set<NodeNumber> expected;
      map.visit_owners(bounds, [&](NodeNumber node) {
        expected.insert(node);
        return true;
      });
      const auto owners = recent.of(map, bounds);
      REQUIRE(owners.size() == expected.size());
      REQUIRE(std::set<NodeNumber>(owners.begin(), owners.end()) == expected);
      REQUIRE(recent.covers(bounds));
    }
  });
}

TEST_CASE("bounds in the interior of a region are covered by its node only") {
  for_each_map(34, [](const RegionMap& map, std::mt19937_64& random) {
    for (NodeNumber node = 0; node < std::min(map.nodes(), 20u); ++node) {
      const Bounds interior = regions::interior(map, node);
      const auto cells = map.table().first(map.grid().cells());
      const bool any = std::count(cells.begin(), cells.end(), node) != 0;
      REQUIRE((interior.lower[0] <= interior.upper[0]) == any);
      for (int round = 0; round < 40; ++round) {
        Bounds bounds = random_bounds(random, 18 + static_cast<unsigned>(random() % 14));
        for (int axis = 0; any && round % 2 == 0 && axis < 3; ++axis) {  // random bounds are rarely inside the interior
          const std::uint64_t across = std::uint64_t{interior.upper[axis]} - interior.lower[axis];
          bounds.lower[axis] = interior.lower[axis] + static_cast<std::uint32_t>(random() % (across + 1));
          bounds.upper[axis] = round % 4 == 0 ? interior.upper[axis] : bounds.lower[axis];
        }
        const bool within = geometry::contains(interior, bounds);
        REQUIRE(within == (interior.lower[0] <= bounds.lower[0] && bounds.upper[0] <= interior.upper[0] &&
                           interior.lower[1] <= bounds.lower[1] && bounds.upper[1] <= interior.upper[1] &&
                           interior.lower[2] <= bounds.lower[2] && bounds.upper[2] <= interior.upper[2]));
        if (within) REQUIRE(map.coverage(bounds, node) == Coverage::all);
      }
    }
  });
}

TEST_CASE(
    "the densest box of a region is owned by its node and contains a part below as many cuts as any of its parts") {
  for_each_map(36, [](const RegionMap& map, std::mt19937_64&) {
    std::vector<Part> parts = parts_of(map);
    for (NodeNumber node = 0; node < std::min(map.nodes(), 20u); ++node) {
      std::size_t most = 0;
      for (const Part& part : parts) most = part.owner == node ? std::max(most, part.cuts) : most;
      const Bounds densest = regions::densest_box(map, node);
      REQUIRE((densest.lower[0] <= densest.upper[0]) == (most > 0));
      if (most == 0) continue;
      REQUIRE(std::count_if(parts.begin(), parts.end(), [&](const Part& part) {
                bool within = part.owner == node && part.cuts == most;
                for (std::size_t axis = 0; axis < 3; ++axis) {
                  within &= part.lower[axis] >= densest.lower[axis] && part.upper[axis] <= densest.upper[axis] + 1ull;
                }
                return within;
              }) >= 1);
      REQUIRE(std::all_of(parts.begin(), parts.end(),
                          [&](const Part& part) { return part.owner == node || !part.overlaps(densest); }));
    }
  });
}

TEST_CASE("the densest box joins the parts of a cell that make a box") {
  // The last cell in quarters across x and y; node 0 owns those with the lower x.
  const CellGrid grid{{1, 1, 0}};
  const std::uint32_t middle = 0xc0000000u;
  const std::array<std::uint32_t, 16> table = {1,
                                               1,
                                               1,
                                               RegionMap::cut_entry(1, 0),  // cells
                                               middle,
                                               RegionMap::cut_entry(0, 1),
                                               RegionMap::cut_entry(0, 2),  // cuts
                                               middle,
                                               0,
                                               1,
                                               middle,
                                               RegionMap::cut_entry(2, 3),
                                               1,
                                               0x80000000u,
                                               0,
                                               0};
  REQUIRE(RegionMap::is_table(table, grid, 2));
  RegionMap map(grid, 2);
  map.assign(table, 2, 2);
  CHECK(regions::densest_box(map, 0) == Bounds{{0x80000000u, 0x80000000u, 0}, {middle - 1, 0xffffffffu, 0xffffffffu}});
}

TEST_CASE("a node that owns all cells covers all bounds, whatever its slot") {
  const CellGrid grid{{2, 1, 2}};
  std::mt19937_64 random(35);
  for (const NodeNumber owner : {0u, 1u, 4u}) {
    CAPTURE(owner);
    RegionMap map(grid, 5);
    CHECK(map.sole_owner() == RegionMap::many_owners);
    std::vector<std::uint32_t> table(grid.cells(), owner);
    for (const bool cut : {false, true}) {
      if (cut) {
        table[3] = RegionMap::cut_entry(1, 0);
        table.insert(table.end(), {1000, owner, owner});
      }
      map.assign(table, 5, map.epoch() + 1);
      CHECK(map.sole_owner() == owner);
      for (int round = 0; round < 40; ++round) {
        const Bounds bounds = random_bounds(random, 32);
        for (NodeNumber node = 0; node < 5; ++node) {
          REQUIRE(map.coverage(bounds, node) == (node == owner ? Coverage::all : Coverage::none));
        }
        REQUIRE(map.pair_owner(bounds, bounds) == owner);
      }
    }
    table.back() = (owner + 1) % 5;
    map.assign(table, 5, map.epoch() + 1);
    CHECK(map.sole_owner() == RegionMap::many_owners);
  }
}

TEST_CASE("the interior of a region that is a box is the whole region") {
  for (const NodeNumber nodes : {1u, 2u, 4u, 8u, 16u}) {
    CAPTURE(nodes);
    const CellGrid grid{{4, 4, 4}};
    const RegionMap map(grid, nodes);
    for (NodeNumber node = 0; node < nodes; ++node) {
      const Bounds interior = regions::interior(map, node);
      double volume = 1;
      for (int axis = 0; axis < 3; ++axis) {
        volume *= static_cast<double>(std::uint64_t{interior.upper[axis]} - interior.lower[axis] + 1) / 4294967296.0;
      }
      CHECK(volume == 1.0 / nodes);
    }
  }
}

TEST_CASE("every cell of a grid has its own index, consecutive along x") {
  const CellGrid grid{{3, 2, 4}};
  std::set<std::uint32_t> seen;
  for (std::uint32_t z = 0; z < grid.along(2); ++z) {
    for (std::uint32_t y = 0; y < grid.along(1); ++y) {
      for (std::uint32_t x = 0; x < grid.along(0); ++x) {
        const std::uint32_t index = grid.index(x, y, z);
        CHECK(index < grid.cells());
        CHECK(seen.insert(index).second);
        CHECK((x == 0 || index == grid.index(x - 1, y, z) + 1));
      }
    }
  }
}

TEST_CASE("cells are half-open: a position on a boundary belongs to the cell above it") {
  // The sides are powers of two, so cell boundaries are exact in metres.
  const FixedSpace space({-8, 0, 16}, {8, 32, 80});
  const CellGrid grid{{2, 3, 4}};
  const double low[3] = {-8, 0, 16};
  const double side[3] = {16.0 / 4, 32.0 / 8, 64.0 / 16};
  for (std::size_t axis = 0; axis < 3; ++axis) {
    for (std::uint32_t cell = 0; cell < grid.along(axis); ++cell) {
      CAPTURE(axis);
      CAPTURE(cell);
      double at[3] = {-8, 0, 16};
      at[axis] = low[axis] + side[axis] * cell;
      std::uint32_t point[3];
      space.point({at[0], at[1], at[2]}, point);
      CHECK(grid.coordinate(point[axis], axis) == cell);
      at[axis] -= 1e-7;  // several steps of the fixed point
      space.point({at[0], at[1], at[2]}, point);
      CHECK(grid.coordinate(point[axis], axis) == (cell == 0 ? 0 : cell - 1));
    }
  }
}

TEST_CASE("the outermost cells reach to infinity") {
  const FixedSpace space({0, 0, 0}, {100, 100, 40});
  const CellGrid grid{{4, 4, 3}};
  const RegionMap map(grid, 13);
  for (const double far : {1e2, 1e9, 1e300}) {
    std::uint32_t point[3];
    space.point({far, far, far}, point);
    CHECK(grid.cell_of(point) == grid.index(15, 15, 7));
    space.point({-far, -far, -far}, point);
    CHECK(grid.cell_of(point) == 0);
    space.point({far, 50, -far}, point);
    CHECK(grid.cell_of(point) == grid.index(15, 8, 0));
    CHECK(map.owner_at(point) == map.table()[grid.index(15, 8, 0)]);
  }
}

TEST_CASE("the cell of an object's position is among the cells of its bounds") {
  constexpr unsigned seed = 8;
  CAPTURE(seed);
  std::mt19937_64 random(seed);
  std::uniform_real_distribution<double> place(-30, 130), size(0, 20);
  const FixedSpace space({0, 0, 0}, {100, 100, 100});
  const CellGrid grid{{5, 4, 6}};
  for (int round = 0; round < 20000; ++round) {
    const Vec3d p{place(random), place(random), place(random)};
    const double r = round % 5 == 0 ? 0 : size(random);
    const CellBox box = grid.cells_of(space.bounds({p.x - r, p.y - r, p.z - r}, {p.x + r, p.y + r, p.z + r}));
    std::uint32_t point[3];
    space.point(p, point);
    for (std::size_t axis = 0; axis < 3; ++axis) {
      const std::uint32_t at = grid.coordinate(point[axis], axis);
      REQUIRE(box.lower[axis] <= at);
      REQUIRE(at <= box.upper[axis]);
    }
  }
}

}  // namespace
}  // namespace ringfence::regions
