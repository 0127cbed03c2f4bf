#include "path_samples.hpp"

#include <cstdint>
#include <utility>

#include <doctest/doctest.h>

namespace ringfence {
namespace {

constexpr std::uint32_t nodes = 5;

/// A frame in which each node needs 0.2 ms for each part, and the server 0.1 ms to collect.
FrameReport even_frame() {
  FrameReport report;
  for (std::uint32_t i = 0; i < nodes; ++i) {
    NodeReport& node = report.nodes.emplace_back();
    node.id = NodeId(i);
    node.moved_ms = node.tested_ms = node.ended_ms = 0.2;
  }
  report.path.collect_ms = 0.1;
  return report;
}

}  // namespace

TEST_CASE("the undisturbed path counts a node that is always slow, and none that is slow in single frames") {
  tools::PathSamples samples;
  for (std::uint32_t frame = 0; frame < 2 * nodes; ++frame) {
    FrameReport report = even_frame();
    report.nodes[frame % nodes].moved_ms += 10;
    report.path.nodes_moved_ms = 10.2;
    report.nodes[3].tested_ms += 1;
    report.path.collect_ms = frame == 4 ? 7 : 0.1;
    samples.add(report);
  }
  const PathReport path = samples.undisturbed();
  CHECK(path.nodes_moved_ms == doctest::Approx(0.2));
  CHECK(path.nodes_tested_ms == doctest::Approx(1.2));
  CHECK(path.nodes_ended_ms == doctest::Approx(0.2));
  CHECK(path.collect_ms == doctest::Approx(0.1));
  CHECK(path.critical_ms() == doctest::Approx(0.2 + 1.2 + 0.2 + 0.1));
}

TEST_CASE("the undisturbed path follows the number of a node, not its place in the report") {
  tools::PathSamples samples;
  for (int frame = 0; frame < 3; ++frame) {
    FrameReport report = even_frame();
    report.nodes[2].ended_ms = 3;
    if (frame == 1) std::swap(report.nodes[2], report.nodes[4]);
    samples.add(report);
  }
  CHECK(samples.undisturbed().nodes_ended_ms == doctest::Approx(3));
}

TEST_CASE("without frames the undisturbed path is 0") { CHECK(tools::PathSamples().undisturbed().critical_ms() == 0); }

}  // namespace ringfence
