// The boxes of a query in the order in which they are taken, against a sorted list.
#include "queries/reached_boxes.hpp"

#include <algorithm>
#include <cstdint>
#include <span>
#include <vector>

#include <doctest/doctest.h>

#include "queries/random_rows.hpp"

namespace ringfence::queries_test {
namespace {

using queries::ReachedBoxes;

struct Row {
  std::uint32_t query, box;
  float at;
};

/// What the search below finds, in the order of the queries.
std::vector<Row>& rows() {
  static std::vector<Row> all;
  return all;
}

bool list_rows(const queries::BoxTree&, std::span<const queries::Reach>, const queries::StreamMemory&,
               queries::Candidates& out, std::uint64_t&) {
  out.size = 0;
  for (const Row& row : rows()) {
    out.queries[out.size] = row.query, out.boxes[out.size] = row.box, out.at[out.size] = row.at;
    ++out.size;
  }
  return true;
}

TEST_CASE("boxes are taken in the order in which they are reached, of few and of many, behind the begin") {
  constexpr std::uint32_t queries = 64;
  Random random(5);
  for (const float begin : {0.0f, 0.375f}) {
    rows().clear();
    for (std::uint32_t query = 0; query < queries; ++query) {
      const std::size_t count = query % 3 == 0 ? 0 : query % 3 == 1 ? random.below(16) : random.below(90);
      for (std::uint32_t i = 0; i < count; ++i) {
        // Often at the same place.
        rows().push_back({query, i, static_cast<float>(random.below(32)) / 32});
      }
    }
    ReachedBoxes boxes;
    std::uint64_t compared = 0;
    REQUIRE(boxes.reserve(queries));
    REQUIRE(boxes.find(list_rows, queries::BoxTree(), queries, compared));
    for (std::uint32_t query = 0; query < queries; ++query) {
      std::vector<float> expected, taken;
      std::vector<std::uint32_t> expected_boxes, taken_boxes;
      for (const Row& row : rows()) {
        if (row.query != query || (begin > 0 && row.at <= begin)) continue;
        expected.push_back(row.at);
        expected_boxes.push_back(row.box);
      }
      std::sort(expected.begin(), expected.end());
      const std::uint32_t end = boxes.end(query);
      for (std::uint32_t next = boxes.start(query, begin); next != end; boxes.bring_nearest(++next, end)) {
        taken.push_back(boxes[next].at);
        taken_boxes.push_back(boxes[next].box);
      }
      std::sort(taken_boxes.begin(), taken_boxes.end());
      CHECK(taken == expected);
      CHECK(taken_boxes == expected_boxes);
    }
  }
}

}  // namespace
}  // namespace ringfence::queries_test
