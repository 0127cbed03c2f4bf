#include "nodes/cd_node/queries/query_answerer.hpp"

#include <algorithm>
#include <vector>

#include <doctest/doctest.h>

#include "nodes/cd_node/node_fixture.hpp"

namespace ringfence::nodes::test {
namespace {

/// A ray along x through all objects of these tests.
messages::QueryRecord ray_along_x() {
  messages::QueryRecord query;
  query.kind = static_cast<std::uint32_t>(messages::QueryKind::cast_all);
  query.start.position = {0, 5, 5};
  query.displacement = {64, 0, 0};
  query.layers = query.categories = ~0u;
  return query;
}

void answer_all(QueryAnswerer& answerer) {
  answerer.begin();
  while (answerer.is_pending()) {
    answerer.answer_some();
  }
}

TEST_CASE("a node answers for the objects whose bounds have their lower corner in its region") {
  for (const Placement placement : {Placement::region, Placement::server}) {
    for (const NodeNumber node : {0u, 1u}) {
      CAPTURE(name_of(placement));
      CAPTURE(node);
      NodeFixture fixture({.node = node, .placement = placement});
      // The border is at x = 32. Both nodes know the objects whose bounds touch it.
      for (const auto& [number, x] : {std::pair(1u, 10.0), {2u, 31.8}, {3u, 32.2}, {4u, 32.8}, {5u, 50.0}}) {
        if (node == 0 ? x < 32.5 : x > 31.5) {
          fixture.know(number, {x, 5, 5});
        }
      }
      const std::vector<messages::QueryRecord> queries{ray_along_x()};
      NodeQueries& shared = fixture.state().contacts.queries;
      shared.queries = queries;
      QueryAnswerer answerer(fixture.state());
      answer_all(answerer);
      CHECK(shared.frame == fixture.state().frame);
      std::vector<std::uint32_t> slots;
      for (const messages::QueryHitRecord& hit : shared.hits) slots.push_back(hit.slot);
      std::sort(slots.begin(), slots.end());
      CHECK((slots == (node == 0 ? std::vector<std::uint32_t>{1, 2, 3} : std::vector<std::uint32_t>{4, 5})));
    }
  }
}

TEST_CASE("many queries are answered in several steps, and a frame that is detected again has no answer twice") {
  NodeFixture fixture;
  fixture.know(1, {10, 5, 5});
  const std::vector<messages::QueryRecord> queries(4000, ray_along_x());
  NodeQueries& shared = fixture.state().contacts.queries;
  shared.queries = queries;
  QueryAnswerer answerer(fixture.state());
  CHECK(!answerer.is_pending());
  answerer.begin();
  answerer.answer_some();
  REQUIRE(answerer.is_pending());
  CHECK(shared.hits.size() < 4000);
  CHECK(shared.frame == NodeQueries::no_frame);
  answerer.discard();
  CHECK(!answerer.is_pending());
  answer_all(answerer);
  CHECK(shared.frame == fixture.state().frame);
  REQUIRE(shared.hits.size() == 4000);
  for (std::uint32_t i = 0; i < 4000; ++i) REQUIRE(shared.hits[i].query == i);
  CHECK(fixture.state().stats.query_tests == 4000);
}

}  // namespace
}  // namespace ringfence::nodes::test
