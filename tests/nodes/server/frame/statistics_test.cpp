#include "nodes/server/frame/statistics.hpp"

#include <array>
#include <memory>
#include <numeric>
#include <vector>

#include <doctest/doctest.h>

#include "link/wake_tree.hpp"
#include "nodes/server/server_fixture.hpp"

namespace ringfence::nodes::test {
namespace {

double stage(const FrameReport& report, Stage stage) { return report.stage_ms[static_cast<std::size_t>(stage)]; }

TEST_CASE("every nanosecond of a frame is charged to one stage, and ingest is taken out of the stage around it") {
  ServerFixture fixture;
  Statistics statistics(fixture.state());
  statistics.begin();
  const std::uint64_t begin = fixture.state().begin_ns;
  REQUIRE(statistics.mark_ns() == begin);
  statistics.add_ingest(3'000'000);
  statistics.charge(Stage::move, begin + 10'000'000);
  statistics.charge_part(Stage::broad_phase, 5'000'000);
  statistics.add_ingest(9'000'000);  // more than the stage: clocks differ
  statistics.charge(Stage::dispatch, begin + 17'000'000);
  const FrameReport& report = fixture.state().report();
  CHECK(stage(report, Stage::move) == doctest::Approx(7));
  CHECK(stage(report, Stage::broad_phase) == doctest::Approx(5));
  CHECK(stage(report, Stage::dispatch) == doctest::Approx(0));
  CHECK(stage(report, Stage::ingest) == doctest::Approx(3 + 2));
  CHECK(std::accumulate(report.stage_ms.begin(), report.stage_ms.end(), 0.0) == doctest::Approx(17));
}

TEST_CASE("a report starts empty and lists the connected nodes by slot, with their ids") {
  ServerFixture fixture({.nodes = 3});
  ServerState& state = fixture.state();
  state.nodes[1].connected = false;
  state.nodes[2].id = 7;
  state.refuse(Status::late);
  Statistics statistics(state);
  statistics.begin();
  statistics.list_nodes();
  REQUIRE(state.report().nodes.size() == 2);
  CHECK(state.report().nodes[0].id == NodeId(0));
  CHECK(state.report().nodes[1].id == NodeId(7));
  CHECK(state.nodes[2].in_report == 1);
  CHECK(state.report().refused[static_cast<std::size_t>(Status::late)] == 0);
}

TEST_CASE("results of a frame that is detected again count once") {
  ServerFixture fixture({.placement = Placement::region});
  ServerState& state = fixture.state();
  Statistics statistics(state);
  statistics.add(state.nodes[0], messages::NarrowDoneRecord{10, 9, 1, 2, 1});
  statistics.add(state.nodes[1], messages::NarrowDoneRecord{20, 20, 0, 3, 0});
  CHECK(state.report().candidates == 30);
  CHECK(state.report().tested == 29);
  statistics.forget_results();
  statistics.add(state.nodes[1], messages::NarrowDoneRecord{25, 24, 0, 4, 2});
  CHECK(state.report().candidates == 25);
  CHECK(state.report().tested == 24);
  CHECK(state.report().failed_supports == 2);
  CHECK(state.report().nodes[0].tested == 0);
  CHECK(state.report().nodes[1].contacts == 4);
}

TEST_CASE("a step is charged to a node up to the moment when the node was reached, and wholly to a lost node") {
  ServerFixture fixture;
  ServerState& state = fixture.state();
  Statistics statistics(state);
  const std::uint64_t begin = 1;  // long ago, so the present moment is the same for both nodes
  state.nodes[0].started.ns = begin;
  state.nodes[1].lost = true;
  statistics.charge_reached(8.0, begin, &PeerSession::started);
  CHECK(state.nodes[0].started.ms == 0);
  CHECK(state.nodes[1].started.ms == 8.0);  // never reached: all of the step
  state.nodes[1].lost = false;
  statistics.charge_reached(8.0, begin, &PeerSession::started);
  CHECK(state.nodes[1].started.ms == 8.0);  // not noted: the same
  Statistics::note_reached(state.nodes[1].started);
  const std::uint64_t noted = state.nodes[1].started.ns;
  CHECK(Statistics::note_reached(state.nodes[1].started));
  CHECK(state.nodes[1].started.ns == noted);
}

TEST_CASE("a node that others wake is reached after the server's step without its rings, and the rings in turn") {
  constexpr std::size_t nodes = 20;
  constexpr double step_ms = 10, ring_ms = 0.25;
  ServerFixture fixture({.nodes = nodes});
  ServerState& state = fixture.state();
  std::array<link::Doorbell, nodes> doorbells;
  std::vector<link::WakeTree::Bell*> bells;
  for (link::Doorbell& bell : doorbells) bells.push_back(&bell);
  state.wake_tree = std::make_shared<link::WakeTree>(bells);
  state.wake_nodes();
  const link::WakeOrder& order = state.wake_tree->order();
  state.rings_ms = order.waker.count * ring_ms;
  Statistics(state).charge_reached(step_ms, 1, &PeerSession::started);

  // Each thread rings its members one after the other; `begin_ms` is when it starts.
  std::size_t reached = 0;
  const auto ring = [&](const auto& self, const link::WakeOrder::Children& children, double begin_ms) -> void {
    for (std::uint32_t i = 0; i < children.count; ++i) {
      const std::uint32_t member = order.rung[children.first + i];
      const double rung_ms = begin_ms + (i + 1) * ring_ms;
      CAPTURE(member);
      CHECK(state.nodes[member].started.ms == doctest::Approx(rung_ms + order.children[member].count * ring_ms));
      ++reached;
      self(self, order.children[member], rung_ms);
    }
  };
  ring(ring, order.waker, step_ms - state.rings_ms);
  CHECK(reached == nodes);
}

TEST_CASE("the critical path has the slowest node of each step, and states in shared memory count as traffic") {
  ServerFixture fixture;
  ServerState& state = fixture.state();
  Statistics statistics(state);
  messages::NodeFrameStats slow_move, slow_end;
  slow_move.cpu_ns = 6'000'000;
  slow_move.move_cpu_ns = 4'000'000;
  slow_end.cpu_ns = 5'000'000;
  slow_end.move_cpu_ns = 1'000'000;
  slow_end.host_owned_changes = 3;
  state.nodes[0].started.ms = 0.5;
  statistics.add(state.nodes[0], slow_move);
  statistics.add(state.nodes[1], slow_end);
  const PathReport& path = state.report().path;
  CHECK(path.node_move_ms == doctest::Approx(4));
  CHECK(path.node_end_ms == doctest::Approx(4));
  CHECK(path.nodes_moved_ms == doctest::Approx(4.5));
  CHECK(state.report().traffic[static_cast<std::size_t>(Traffic::state)].records == 3);
}

}  // namespace
}  // namespace ringfence::nodes::test
