#include "queries/box_tree.hpp"

#include <algorithm>
#include <limits>
#include <vector>

#include <doctest/doctest.h>

#include "geometry/every_target.hpp"
#include "queries/random_rows.hpp"
#include "queries/tree_kernels.hpp"

namespace ringfence::queries_test {
namespace {

using geometry::Bounds;
using queries::BoxTree;

/// A box in metres.
struct MetricBox {
  double lower[3], upper[3];
};

/// Boxes in a space of 100 m, one metre a side on average.
struct Boxes {
  std::vector<MetricBox> metric;
  std::vector<Bounds> bounds;
  std::vector<float> margins;
  geometry::FixedSpace space{{-50, -50, -50}, {50, 50, 50}};

  Boxes(std::size_t count, double half, std::uint64_t seed) {
    Random random(seed);
    for (std::size_t i = 0; i < count; ++i) {
      const Vec3d at = random.in_cube(half);
      const Vec3d size{random.uniform(0, 1), random.uniform(0, 1), random.uniform(0, 1)};
      metric.push_back({{at.x, at.y, at.z}, {at.x + size.x, at.y + size.y, at.z + size.z}});
      bounds.push_back(space.bounds(at, {at.x + size.x, at.y + size.y, at.z + size.z}));
      margins.push_back(0);
    }
  }
};

/// Where a ray is in a box, computed in double: the fraction at which it enters, or infinity.
double enters(const MetricBox& box, const double start[3], const double way[3]) {
  double from = 0, to = 1;
  for (int a = 0; a < 3; ++a) {
    if (way[a] == 0) {
      if (start[a] < box.lower[a] || start[a] > box.upper[a]) return std::numeric_limits<double>::infinity();
      continue;
    }
    const double p = (box.lower[a] - start[a]) / way[a], q = (box.upper[a] - start[a]) / way[a];
    from = std::max(from, std::min(p, q));
    to = std::min(to, std::max(p, q));
  }
  return from <= to ? from : std::numeric_limits<double>::infinity();
}

struct Visits {
  const BoxTree& tree;
  std::vector<std::uint32_t> boxes;
  double limit = 0;
  static double visit(void* self, std::uint32_t box, double limit) {
    Visits& visits = *static_cast<Visits*>(self);
    visits.boxes.push_back(box);
    visits.limit = limit;
    return limit;
  }
};

TEST_CASE("a search visits each box that a ray reaches, once, and few others, on every target") {
  for (const std::size_t count : {0u, 1u, 7u, 8u, 9u, 64u, 65u, 700u, 5000u}) {
    CAPTURE(count);
    const Boxes boxes(count, 40, count + 1);
    BoxTree tree;
    tree.build(boxes.bounds, boxes.margins, boxes.space);
    REQUIRE(tree.size() == count);
    test::on_every_target([&] {
      const queries::TreeKernels kernels = queries::choose_tree_kernels();
      Random random(5);
      for (int i = 0; i < 60; ++i) {
        const Vec3d start = random.in_cube(50);
        Vec3d way = random.in_cube(random.below(3) == 0 ? 1 : 90);
        if (i % 5 == 0) way.y = 0;
        if (i % 20 == 0) way = {};
        const double s[3] = {start.x, start.y, start.z}, w[3] = {way.x, way.y, way.z};
        const double limit = i % 3 == 0 ? 0.5 : 1;
        Visits visits{tree, {}};
        const std::uint64_t compared =
            kernels.reach(tree, tree.reach(start, start, way), limit, Visits::visit, &visits);
        CHECK((compared > 0 || count == 0));
        std::sort(visits.boxes.begin(), visits.boxes.end());
        CHECK(std::adjacent_find(visits.boxes.begin(), visits.boxes.end()) == visits.boxes.end());
        for (std::uint32_t box = 0; box < count; ++box) {
          const bool visited = std::binary_search(visits.boxes.begin(), visits.boxes.end(), box);
          MetricBox larger = boxes.metric[box];
          for (int a = 0; a < 3; ++a) larger.lower[a] -= 1e-4, larger.upper[a] += 1e-4;
          if (enters(boxes.metric[box], s, w) <= limit) CHECK(visited);
          if (enters(larger, s, w) > limit + 1e-5) CHECK(!visited);
        }
      }
    });
  }
}

TEST_CASE("a search for a batch lists what each of its queries reaches, or says that there is too little room") {
  for (const std::size_t count : {0u, 1u, 8u, 9u, 70u, 3000u}) {
    CAPTURE(count);
    const Boxes boxes(count, 40, count + 20);
    BoxTree tree;
    tree.build(boxes.bounds, boxes.margins, boxes.space);
    test::on_every_target([&] {
      const queries::TreeKernels kernels = queries::choose_tree_kernels();
      Random random(9);
      std::vector<queries::Reach> reaches;
      std::vector<std::vector<std::uint32_t>> alone, together;
      for (int i = 0; i < 90; ++i) {
        const Vec3d start = random.in_cube(50), way = i % 9 == 0 ? Vec3d{} : random.in_cube(60);
        queries::Reach reach = tree.reach(start, start, way);
        reach.limit = i % 4 == 0 ? 0.25f : 1;
        Visits visits{tree, {}};
        kernels.reach(tree, reach, double{reach.limit}, Visits::visit, &visits);
        reaches.push_back(reach);
        alone.push_back(visits.boxes);
      }
      const std::size_t lists = (queries::max_levels + 1) * (reaches.size() + queries::stream_slack);
      std::vector<std::uint32_t> queries(lists);
      std::vector<std::uint8_t> masks(lists);
      const std::size_t room = (8 * count + 8) * reaches.size() + queries::stream_slack;
      std::vector<std::uint32_t> of(room), reached(room);
      std::vector<float> at(room);
      queries::Candidates found{of.data(), reached.data(), at.data(), 0, room};
      std::uint64_t compared = 0;
      CHECK(kernels.reach_all(tree, reaches, {queries.data(), masks.data()}, found, compared));
      together.resize(reaches.size());
      for (std::size_t i = 0; i < found.size; ++i) {
        together[of[i]].push_back(reached[i]);
        CHECK(at[i] >= 0);
        CHECK(at[i] <= reaches[of[i]].limit * 1.001f);
      }
      for (std::size_t i = 0; i < reaches.size(); ++i) {
        std::sort(alone[i].begin(), alone[i].end());
        std::sort(together[i].begin(), together[i].end());
        CHECK(alone[i] == together[i]);
      }
      if (found.size < 100) return;
      found = {of.data(), reached.data(), at.data(), 0, found.size / 2};
      CHECK(!kernels.reach_all(tree, reaches, {queries.data(), masks.data()}, found, compared));
      CHECK(found.size <= found.room);
    });
  }
}

TEST_CASE("a search by distance visits each box within the limit, nearer ones about first, on every target") {
  const Boxes boxes(3000, 40, 7);
  BoxTree tree;
  tree.build(boxes.bounds, boxes.margins, boxes.space);
  test::on_every_target([&] {
    const queries::TreeKernels kernels = queries::choose_tree_kernels();
    Random random(6);
    for (int i = 0; i < 40; ++i) {
      const Vec3d point = random.in_cube(60);
      const double limit = i % 4 == 0 ? std::numeric_limits<double>::infinity() : random.uniform(0, 30);
      Visits visits{tree, {}};
      kernels.near(tree, tree.reach(point, point, {}), limit, Visits::visit, &visits);
      std::sort(visits.boxes.begin(), visits.boxes.end());
      const double at[3] = {point.x, point.y, point.z};
      for (std::uint32_t box = 0; box < boxes.metric.size(); ++box) {
        double squared = 0;
        for (int a = 0; a < 3; ++a) {
          const double apart = std::max({0.0, boxes.metric[box].lower[a] - at[a], at[a] - boxes.metric[box].upper[a]});
          squared += apart * apart;
        }
        const bool visited = std::binary_search(visits.boxes.begin(), visits.boxes.end(), box);
        if (std::sqrt(squared) <= limit) CHECK(visited);
        if (std::sqrt(squared) > limit + 1e-3) CHECK(!visited);
      }
    }
  });
}

TEST_CASE("a visit that lowers the limit prunes the rest, and a negative limit ends the search") {
  const Boxes boxes(3000, 8, 8);
  BoxTree tree;
  tree.build(boxes.bounds, boxes.margins, boxes.space);
  const queries::TreeKernels kernels = queries::choose_tree_kernels();
  std::size_t visited = 0;
  const auto end = [](void* count, std::uint32_t, double) {
    ++*static_cast<std::size_t*>(count);
    return -1.0;
  };
  kernels.reach(tree, tree.reach({-45, 0, 0}, {-45, 3, 3}, {90, 0, 0}), 1, end, &visited);
  CHECK(visited == 1);
  struct Entered {
    const Boxes& boxes;
    const BoxTree& tree;
    std::size_t visits = 0;
    double least = 2;
  } entered{boxes, tree};
  const auto enter = [](void* of, std::uint32_t box, double limit) {
    auto& e = *static_cast<Entered*>(of);
    ++e.visits;
    const double start[3] = {-45, 0, 0}, way[3] = {90, 0.1, 0.1};
    const double at = enters(e.boxes.metric[box], start, way);
    e.least = std::min(e.least, at);
    return std::min(limit, at);
  };
  const std::uint64_t pruned =
      kernels.reach(tree, tree.reach({-45, 0, 0}, {-45, 0, 0}, {90, 0.1, 0.1}), 1, enter, &entered);
  Visits all{tree, {}};
  const std::uint64_t compared =
      kernels.reach(tree, tree.reach({-45, 0, 0}, {-45, 0, 0}, {90, 0.1, 0.1}), 1, Visits::visit, &all);
  CHECK(pruned < compared);
  CHECK(entered.visits < all.boxes.size());
  for (const std::uint32_t box : all.boxes) {
    const double start[3] = {-45, 0, 0}, way[3] = {90, 0.1, 0.1};
    CHECK(enters(boxes.metric[box], start, way) >= entered.least);
  }
}

TEST_CASE("a box on the surface of the space reaches to infinity, and margins widen boxes") {
  const geometry::FixedSpace space({0, 0, 0}, {10, 10, 10});
  const std::vector<Bounds> bounds = {space.bounds({20, 1, 1}, {30, 2, 2}), space.bounds({4, 4, 4}, {5, 5, 5})};
  BoxTree tree;
  tree.build(bounds, std::vector<float>{0, 1}, space);
  const queries::TreeKernels kernels = queries::choose_tree_kernels();
  const auto visited = [&](const Vec3d& point) {
    Visits visits{tree, {}};
    kernels.reach(tree, tree.reach(point, point, {}), 1, Visits::visit, &visits);
    return visits.boxes.size();
  };
  CHECK(visited({25, 1.5, 1.5}) == 1);
  CHECK(visited({1e14, 1.5, 1.5}) == 1);
  CHECK(visited({25, 3, 1.5}) == 0);
  CHECK(visited({3.01, 3.01, 5.99}) == 1);
  CHECK(visited({2.99, 4.5, 4.5}) == 0);
}

}  // namespace
}  // namespace ringfence::queries_test
