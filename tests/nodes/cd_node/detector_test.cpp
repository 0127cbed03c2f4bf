#include "nodes/cd_node/detector.hpp"

#include <map>
#include <random>
#include <set>

#include <doctest/doctest.h>

#include "nodes/cd_node/node_fixture.hpp"

namespace ringfence::nodes::test {
namespace {

using NumberPair = std::pair<ObjectNumber, ObjectNumber>;

/// The hits in their sorted order.
std::vector<NumberPair> hits(const NodeState& state, const Detector& detector) {
  std::vector<NumberPair> pairs;
  for (std::size_t i = 0; i < detector.hits().size(); ++i) {
    const geometry::CandidatePair& hit = detector.hits()[detector.order().at(i)];
    pairs.emplace_back(state.objects.numbers()[hit.a], state.objects.numbers()[hit.b]);
  }
  return pairs;
}

TEST_CASE("two nodes that sweep find each pair in contact once, wherever the border is") {
  constexpr unsigned seed = 3;
  CAPTURE(seed);
  std::mt19937_64 random(seed);
  std::uniform_real_distribution<double> near(30, 34);
  std::map<ObjectNumber, Vec3d> balls;
  for (ObjectNumber number = 1; number <= 60; ++number) {
    balls[number] = {near(random), near(random), near(random)};
  }
  std::multiset<NumberPair> found;
  for (const NodeNumber node : {0u, 1u}) {
    NodeFixture fixture({.node = node});
    for (const auto& [number, position] : balls) {
      if (fixture.state().region.coverage(fixture.bounds(position)) != regions::Coverage::none) {
        fixture.know(number, position);
      }
    }
    Detector detector(fixture.state());
    detector.discard();
    detector.test_all();
    detector.finish();
    const auto own = hits(fixture.state(), detector);
    CHECK(std::is_sorted(own.begin(), own.end()));
    CHECK(detector.totals().contacts == own.size());
    CHECK(detector.totals().tested == detector.totals().candidates);
    found.insert(own.begin(), own.end());
  }
  std::multiset<NumberPair> expected;
  for (const auto& [a, p] : balls) {
    for (const auto& [b, q] : balls) {
      const double x = p.x - q.x, y = p.y - q.y, z = p.z - q.z;
      if (a < b && x * x + y * y + z * z <= 1) expected.insert({a, b});
    }
  }
  CHECK(!expected.empty());
  CHECK(found == expected);
}

TEST_CASE("hits of balls that rest are carried over between frames, but not to a second detection of a frame") {
  NodeFixture fixture;
  std::vector<NumberPair> expected;
  for (ObjectNumber number = 1; number <= 30; ++number) {
    fixture.know(number, {2 + 0.75 * static_cast<double>(number), 10, 10});
    if (number > 1) expected.emplace_back(number - 1, number);
  }
  Detector detector(fixture.state());
  const auto detect = [&] {
    detector.test_all();
    detector.finish();
    CHECK(hits(fixture.state(), detector) == expected);
    CHECK(detector.totals().candidates == detector.totals().tested + detector.totals().carried);
    return detector.totals().carried;
  };
  std::vector<std::uint64_t> carried;
  for (int frame = 0; frame < 4; ++frame) {
    detector.begin();
    carried.push_back(detect());
  }
  CHECK(carried == std::vector<std::uint64_t>{0, 0, 29, 29});
  fixture.know(1, {2.75, 10.0625, 10});  // moves, and still touches the next ball
  detector.begin();
  CHECK(detect() == 28);
  detector.discard();  // a node is lost: the frame is detected again
  CHECK(detector.hits().empty());
  CHECK(detect() == 0);
  detector.begin();
  CHECK(detect() == 28);
}

TEST_CASE("a node that receives its pairs tests exactly these, and counts them by kind") {
  NodeFixture fixture({.placement = Placement::server});
  fixture.know(1, {10, 10, 10});
  fixture.know(2, {10.5, 10, 10});
  fixture.know(3, {11, 10, 10});
  Detector detector(fixture.state());
  detector.receive_pairs(fixture.message(MessageType::pairs, messages::PairRecord{2, 3}));
  CHECK(fixture.state().received.pairs);
  detector.test_all();
  detector.finish();
  CHECK(hits(fixture.state(), detector) == std::vector<NumberPair>{{2, 3}});
  CHECK(detector.totals().candidates == 1);
  REQUIRE(detector.kinds().size() == 1);
  const messages::KindRecord& kinds = detector.kinds()[0];
  CHECK(kinds.first == static_cast<std::uint32_t>(ShapeKind::sphere));
  CHECK(kinds.second == static_cast<std::uint32_t>(ShapeKind::sphere));
  CHECK(kinds.candidates == 1);
  CHECK(kinds.hits == 1);
}

TEST_CASE("a frame that is detected again counts only its last detection") {
  NodeFixture fixture({.placement = Placement::server});
  fixture.know(1, {10, 10, 10});
  fixture.know(2, {10.5, 10, 10});
  Detector detector(fixture.state());
  for (int detection = 0; detection < 2; ++detection) {
    detector.discard();
    CHECK(detector.hits().empty());
    detector.receive_pairs(fixture.message(MessageType::pairs, messages::PairRecord{1, 2}));
    detector.test_all();
    detector.finish();
    CHECK(detector.totals().candidates == 1);
    CHECK(detector.totals().tested == 1);
    CHECK(detector.totals().contacts == 1);
  }
}

}  // namespace
}  // namespace ringfence::nodes::test
