// Overlaps of many pairs at once, against each pair by itself.
#include "narrow_phase/query/overlap_tests.hpp"

#include <vector>

#include <doctest/doctest.h>

#include "geometry/every_target.hpp"
#include "narrow_phase/query/query_world.hpp"

namespace ringfence::narrow_phase_test {
namespace {

using narrow_phase::Body;
using narrow_phase::OverlapTests;

constexpr ShapeKind kinds[] = {ShapeKind::sphere, ShapeKind::box, ShapeKind::capsule, ShapeKind::hull};

/// Adds the tests of a world, the query shape anew for each, and compares the results.
void check(OverlapTests& tests, const QueryWorld& world, std::size_t& found) {
  const geometry::ShapeView shapes = world.pairs.shapes().view();
  std::vector<std::uint8_t> expected;
  for (const QueryCase& query : world.cases) {
    const Body &object = world.target(query), &moving = world.moving(query);
    std::uint32_t triangle = 0;
    expected.push_back(narrow_phase::overlaps(shapes, object.shape, object.pose,
                                              {shapes, moving.shape, moving.pose.orientation}, query.start, triangle));
    tests.set_query({query.start, moving.pose.orientation}, moving.shape);
    tests.add(object.pose, object.shape);
  }
  CHECK(tests.size() == expected.size());
  const std::span<const std::uint8_t> results = tests.run(shapes);
  CHECK(std::vector(results.begin(), results.end()) == expected);
  CHECK(tests.size() == 0);
  for (const std::uint8_t one : expected) found += one;
}

TEST_CASE("many pairs at once overlap where each by itself does, on every target") {
  std::size_t found = 0;
  std::uint64_t seed = 900;
  for (const ShapeKind target : kinds) {
    for (const ShapeKind moving : kinds) {
      for (const bool hard : {false, true}) {
        ++seed;
        const QueryWorld world = make_queries(target, moving, hard, 300, seed);
        test::on_every_target([&] {
          OverlapTests tests;
          check(tests, world, found);
          check(tests, world, found);
        });
      }
    }
  }
  CHECK(found > 1000);
}

TEST_CASE("the shape of the query stays when its first tests have run, and pairs of all kinds may be mixed") {
  geometry::ShapeTable table;
  const ShapeNumber shapes[] = {table.add(Sphere{1}), table.add(Box{{1, 1, 1}}), table.add(Capsule{1, 1}),
                                table.add(Box{{1000, 1000, 1}})};
  OverlapTests tests;
  CHECK(tests.run(table.view()).empty());
  tests.set_query({{0, 0, 0}, {}}, shapes[1]);
  for (int run = 0; run < 3; ++run) {
    for (const ShapeNumber shape : shapes) {
      tests.add({{0, 0, 1.5}, {}}, shape);
      tests.add({{0, 0, 50}, {}}, shape);
    }
    const std::span<const std::uint8_t> results = tests.run(table.view());
    REQUIRE(results.size() == 8);
    for (std::size_t i = 0; i < 8; ++i) CHECK(results[i] == (i % 2 == 0 ? 1 : 0));
  }
  tests.set_query({{0, 0, 50}, {}}, shapes[0]);
  tests.add({{0, 0, 50}, {}}, shapes[0]);
  tests.clear();
  CHECK(tests.run(table.view()).empty());
}

}  // namespace
}  // namespace ringfence::narrow_phase_test
