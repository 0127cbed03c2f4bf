#include "queries/box_tree.hpp"

#include <algorithm>
#include <cstring>
#include <limits>
#include <numeric>
#include <vector>

#include <doctest/doctest.h>

#include "geometry/every_target.hpp"
#include "queries/random_rows.hpp"
#include "queries/tree_kernels.hpp"

namespace ringfence::queries_test {
namespace {

using queries::BoxTree;
using queries::RowBounds;

/// A box in metres.
struct MetricBox {
  double lower[3], upper[3];
};

/// Boxes in a space of 100 m, one metre a side on average, in a random order.
struct Boxes {
  std::vector<MetricBox> metric;  ///< in that order
  std::vector<RowBounds> of_rows;
  std::vector<std::uint32_t> order;
  geometry::FixedSpace space{{-50, -50, -50}, {50, 50, 50}};
  queries::BoxConverter box_of{space, {3, -2, 7}};

  Boxes(std::size_t count, double half, std::uint64_t seed) {
    Random random(seed);
    of_rows.resize(count);
    order.resize(count);
    std::iota(order.begin(), order.end(), 0u);
    for (std::size_t i = count; i > 1; --i) std::swap(order[i - 1], order[random.below(i)]);
    for (std::size_t i = 0; i < count; ++i) {
      const Vec3d at = random.in_cube(half);
      const Vec3d size{random.uniform(0, 1), random.uniform(0, 1), random.uniform(0, 1)};
      metric.push_back({{at.x, at.y, at.z}, {at.x + size.x, at.y + size.y, at.z + size.z}});
      of_rows[order[i]] = {space.bounds(at, {at.x + size.x, at.y + size.y, at.z + size.z}), 0};
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

/// What a search for a batch writes, with room for all boxes of each query.
struct BatchMemory {
  std::vector<std::uint32_t> of, reached, inner_queries, inner_groups;
  std::vector<float> at;
  queries::Candidates found;

  BatchMemory(std::size_t queries, std::size_t boxes)
      : of((8 * boxes + 8) * queries + queries::stream_slack),
        reached(of.size()),
        inner_queries(of.size()),
        inner_groups(of.size()),
        at(of.size()),
        found{of.data(), reached.data(), at.data(), 0, of.size()} {}
  BatchMemory(const BatchMemory&) = delete;
  BatchMemory& operator=(const BatchMemory&) = delete;
  queries::StreamMemory stream() { return {inner_queries.data(), inner_groups.data()}; }
};

/// Metres from a point to a box.
double distance(const MetricBox& box, const Vec3d& point) {
  const double at[3] = {point.x, point.y, point.z};
  double squared = 0;
  for (int a = 0; a < 3; ++a) {
    const double apart = std::max({0.0, box.lower[a] - at[a], at[a] - box.upper[a]});
    squared += apart * apart;
  }
  return std::sqrt(squared);
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
    tree.build(boxes.of_rows, boxes.order, boxes.box_of);
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
    tree.build(boxes.of_rows, boxes.order, boxes.box_of);
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
      BatchMemory memory(reaches.size(), count);
      queries::Candidates& found = memory.found;
      std::uint64_t compared = 0;
      CHECK(kernels.reach_all(tree, reaches, memory.stream(), found, compared));
      together.resize(reaches.size());
      for (std::size_t i = 0; i < found.size; ++i) {
        if (i > 0) CHECK(found.queries[i] >= found.queries[i - 1]);
        together[found.queries[i]].push_back(found.boxes[i]);
        CHECK(found.at[i] >= 0);
        CHECK(found.at[i] <= reaches[found.queries[i]].limit * 1.001f);
      }
      for (std::size_t i = 0; i < reaches.size(); ++i) {
        std::sort(alone[i].begin(), alone[i].end());
        std::sort(together[i].begin(), together[i].end());
        CHECK(alone[i] == together[i]);
      }
      if (found.size < 100) return;
      found.room = found.size / 2;
      found.size = 0;
      CHECK(!kernels.reach_all(tree, reaches, memory.stream(), found, compared));
      CHECK(found.size <= found.room);
    });
  }
}

TEST_CASE("a search by distance visits each box within the limit, nearer ones about first, on every target") {
  const Boxes boxes(3000, 40, 7);
  BoxTree tree;
  tree.build(boxes.of_rows, boxes.order, boxes.box_of);
  test::on_every_target([&] {
    const queries::TreeKernels kernels = queries::choose_tree_kernels();
    Random random(6);
    for (int i = 0; i < 40; ++i) {
      const Vec3d point = random.in_cube(60);
      const double limit = i % 4 == 0 ? std::numeric_limits<double>::infinity() : random.uniform(0, 30);
      Visits visits{tree, {}};
      kernels.near(tree, tree.reach(point, point, {}), limit, Visits::visit, &visits);
      std::sort(visits.boxes.begin(), visits.boxes.end());
      for (std::uint32_t box = 0; box < boxes.metric.size(); ++box) {
        const double apart = distance(boxes.metric[box], point);
        const bool visited = std::binary_search(visits.boxes.begin(), visits.boxes.end(), box);
        if (apart <= limit) CHECK(visited);
        if (apart > limit + 1e-3) CHECK(!visited);
      }
    }
  });
}

TEST_CASE("a batch near points lists the boxes within the distance of each, on every target") {
  const Boxes boxes(3000, 40, 30);
  BoxTree tree;
  tree.build(boxes.of_rows, boxes.order, boxes.box_of);
  test::on_every_target([&] {
    const queries::TreeKernels kernels = queries::choose_tree_kernels();
    Random random(31);
    std::vector<queries::Reach> reaches;
    std::vector<Vec3d> points;
    for (int i = 0; i < 50; ++i) {
      points.push_back(random.in_cube(60));
      reaches.push_back(tree.reach(points.back(), points.back(), {}));
      reaches.back().limit = i % 7 == 0 ? 0 : static_cast<float>(random.uniform(0, 15));
    }
    BatchMemory memory(reaches.size(), boxes.metric.size());
    const queries::Candidates& found = memory.found;
    std::uint64_t compared = 0;
    REQUIRE(kernels.near_all(tree, reaches, memory.stream(), memory.found, compared));
    std::vector<std::vector<bool>> listed(reaches.size(), std::vector<bool>(boxes.metric.size()));
    for (std::size_t i = 0; i < found.size; ++i) {
      CHECK(!listed[found.queries[i]][found.boxes[i]]);
      listed[found.queries[i]][found.boxes[i]] = true;
    }
    for (std::size_t i = 0; i < reaches.size(); ++i) {
      for (std::uint32_t box = 0; box < boxes.metric.size(); ++box) {
        const double apart = distance(boxes.metric[box], points[i]);
        if (apart <= double{reaches[i].limit}) CHECK(listed[i][box]);
        if (apart > double{reaches[i].limit} + 1e-3) CHECK(!listed[i][box]);
      }
    }
  });
}

TEST_CASE("leaves are the boxes of their rows, widened by their margins, on every target") {
  for (const std::size_t count : {1u, 8u, 77u}) {
    Boxes boxes(count, 60, 5);  // some saturate
    for (std::size_t i = 0; i < count; ++i) boxes.of_rows[i].margin = static_cast<float>(i % 5);
    BoxTree tree;
    test::on_every_target([&] {
      tree.build(boxes.of_rows, boxes.order, boxes.box_of);
      for (std::size_t i = 0; i < count; ++i) {
        const queries::TreeBox box = boxes.box_of(boxes.of_rows[boxes.order[i]]);
        const queries::BoxGroup& group = tree.level(0)[i / queries::tree_width];
        for (std::size_t a = 0; a < 3; ++a) {
          const float lower = group.lower[a][i % queries::tree_width], upper = group.upper[a][i % queries::tree_width];
          CHECK((lower == box.lower[a] || lower == doctest::Approx(box.lower[a]).epsilon(1e-6)));
          CHECK((upper == box.upper[a] || upper == doctest::Approx(box.upper[a]).epsilon(1e-6)));
        }
      }
    });
  }
}

TEST_CASE("a visit that lowers the limit prunes the rest, and a negative limit ends the search") {
  const Boxes boxes(3000, 8, 8);
  BoxTree tree;
  tree.build(boxes.of_rows, boxes.order, boxes.box_of);
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

TEST_CASE("a tree of which some boxes were updated is the tree that is built of all of them") {
  for (const std::size_t count : {1u, 7u, 8u, 65u, 512u, 4100u}) {
    for (const std::size_t of_a_hundred : {0u, 2u, 50u, 100u}) {
      CAPTURE(count);
      CAPTURE(of_a_hundred);
      Boxes boxes(count, 40, count + of_a_hundred);
      const Boxes later(count, 40, 1000 + count);
      BoxTree updated, built;
      updated.build(boxes.of_rows, boxes.order, boxes.box_of);
      Random random(count);
      std::vector<std::uint32_t> changed;
      for (std::size_t box = 0; box < count; ++box) {
        if (random.below(100) >= of_a_hundred) continue;
        boxes.of_rows[boxes.order[box]] = later.of_rows[box];
        const auto group = static_cast<std::uint32_t>(box / queries::tree_width);
        if (changed.empty() || changed.back() != group) changed.push_back(group);
      }
      updated.update(boxes.of_rows, boxes.order, boxes.box_of, changed);
      built.build(boxes.of_rows, boxes.order, boxes.box_of);
      REQUIRE(updated.size() == built.size());
      REQUIRE(updated.levels() == built.levels());
      CHECK(updated.cost() == built.cost());
      for (std::size_t level = 0; level < built.levels(); ++level) {
        const std::size_t groups = (built.nodes(level) + queries::tree_width - 1) / queries::tree_width;
        CHECK(std::memcmp(updated.level(level), built.level(level), groups * sizeof(queries::BoxGroup)) == 0);
      }
    }
  }
}

}  // namespace
}  // namespace ringfence::queries_test
