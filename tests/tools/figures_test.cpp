#include "figures.hpp"

#include <doctest/doctest.h>

namespace ringfence::tools {

TEST_CASE("percentiles are measured times, selected by nearest rank") {
  Figures figures;
  for (int i = 200; i >= 1; --i) {
    FrameReport report;
    report.frame_ms = i;
    report.tested = 3;
    report.nodes.resize(2);
    report.nodes[1].id = NodeId(1);
    report.nodes[1].busy_ms = 2 * i;
    figures.add(report, {});
  }
  CHECK(figures.frame_ms().mean == doctest::Approx(100.5));
  CHECK(figures.frame_ms().p50 == 100);
  CHECK(figures.frame_ms().p99 == 198);
  CHECK(figures.frame_ms().max == 200);
  CHECK(figures.tested == 600);
  CHECK(figures.nodes()[0].busy_ms == 0);
  CHECK(figures.nodes()[1].busy_ms == doctest::Approx(201));
}

TEST_CASE("statistics of a node are its own, also if its slot is another node's later") {
  Figures figures;
  FrameReport report;
  report.nodes.resize(2);
  report.nodes[0] = {.id = NodeId(0), .tested = 10};
  report.nodes[1] = {.id = NodeId(1), .tested = 6};
  figures.add(report, {});
  report.nodes[0] = {.id = NodeId(2), .tested = 4};  // node 0 is lost
  figures.add(report, {});
  REQUIRE(figures.nodes().size() == 3);
  const double tested[] = {5, 6, 2};
  for (std::uint32_t id = 0; id < 3; ++id) {
    CHECK(figures.nodes()[id].id == id);
    CHECK(figures.nodes()[id].tested == doctest::Approx(tested[id]));
  }
}

TEST_CASE("statistics of the narrow phase are summed by pair of kinds and sorted by kind") {
  Figures figures;
  for (std::uint64_t i = 1; i <= 10; ++i) {
    FrameReport report;
    report.kinds.resize(i > 5 ? 2 : 1);
    report.kinds[0].first = report.kinds[0].second = ShapeKind::hull;
    report.kinds[0].candidates = i;
    report.kinds[0].cost[7] = 2;
    if (i > 5) report.kinds[1].second = ShapeKind::box;
    figures.add(report, {});
  }
  REQUIRE(figures.kinds().size() == 2);
  CHECK(figures.kinds()[0].second == ShapeKind::box);
  CHECK(figures.kinds()[1].candidates == 55);
  CHECK(figures.kinds()[1].cost[7] == 20);
}

TEST_CASE("imbalance uses complete windows of frames with one node count, and is 1 without such a window") {
  Imbalance imbalance;
  CHECK(imbalance.mean() == 1);
  const double even[] = {2, 2, 2, 2}, skew[] = {1, 6, 1, 0}, two[] = {1, 3};
  for (std::uint32_t frame = 0; frame < Imbalance::window; ++frame) imbalance.add(frame % 2 == 0 ? even : skew);
  CHECK(imbalance.mean() == doctest::Approx(2));  // busiest node: 8 frames of 2 and 8 of 6; mean: 2 per frame
  for (std::uint32_t frame = 0; frame + 1 < Imbalance::window; ++frame) imbalance.add(skew);
  for (std::uint32_t frame = 0; frame < 2 * Imbalance::window; ++frame) imbalance.add(two);
  CHECK(imbalance.windows() == 3);
  CHECK(imbalance.max() == doctest::Approx(2));
  CHECK(imbalance.mean() == doctest::Approx(5.0 / 3));
}

TEST_CASE("statistics without frames are zero or empty") {
  const Figures figures;
  CHECK(figures.frame_ms().p99 == 0);
  CHECK(figures.mean(5) == 0);
  CHECK(figures.nodes().empty());
}

}  // namespace ringfence::tools
