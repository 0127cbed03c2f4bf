#include "figures.hpp"

#include <doctest/doctest.h>

namespace ringfence::tools {

TEST_CASE("percentiles are times that were measured, by nearest rank") {
  Figures figures;
  for (int i = 200; i >= 1; --i) {
    FrameReport report;
    report.frame_ms = i;
    report.tested = 3;
    report.nodes.resize(2);
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

TEST_CASE("no frames make no figures, and no division by zero") {
  const Figures figures;
  CHECK(figures.frame_ms().p99 == 0);
  CHECK(figures.mean(5) == 0);
  CHECK(figures.nodes().empty());
}

}  // namespace ringfence::tools
