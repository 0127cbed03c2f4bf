#include "nodes/server/frame/report_reader.hpp"

#include <doctest/doctest.h>

#include "nodes/server/server_fixture.hpp"

namespace ringfence::nodes::test {
namespace {

struct Reading {
  Reading() {
    state().stage = FrameStage::colliding;
    reader.begin();
  }
  ServerState& state() { return fixture.state(); }
  bool read() {
    reader.look();
    return reader.accept();
  }
  const PeerSession::Received& received(NodeNumber node) { return state().nodes[node].received; }

  ServerFixture fixture{{.nodes = 3, .shares_memory = true}};
  ObjectStates states{fixture.state(), fixture.exchange()};
  Statistics statistics{fixture.state()};
  NodeResults results{fixture.state(), fixture.exchange(), states, statistics};
  ReportReader reader{fixture.state(), results, statistics};
};

TEST_CASE("a step is complete when all nodes have reported it") {
  Reading test;
  CHECK(!test.reader.all(ReportedStep::moved));
  for (const NodeNumber node : {2u, 0u}) {
    test.fixture.report(node, ReportedStep::moved);
    CHECK(test.read());
  }
  CHECK(!test.reader.all(ReportedStep::moved));
  test.fixture.report(0, ReportedStep::moved);  // again
  CHECK(!test.read());
  CHECK(!test.reader.all(ReportedStep::moved));
  test.fixture.report(1, ReportedStep::moved);
  CHECK(test.read());
  CHECK(test.reader.all(ReportedStep::moved));
  CHECK(!test.reader.all(ReportedStep::tested));
  test.reader.begin();
  CHECK(!test.reader.all(ReportedStep::moved));
}

TEST_CASE("a report is only what the node had completed when the server looked") {
  Reading test;
  test.fixture.report(0, ReportedStep::moved);
  test.reader.look();
  test.fixture.report(0, ReportedStep::tested);  // its messages may be behind those that were read
  CHECK(test.reader.accept());
  CHECK(test.received(0).states);
  CHECK(!test.received(0).narrow_done);
  CHECK(test.read());
  CHECK(test.received(0).narrow_done);
}

TEST_CASE(
    "after a loss the server looks at every node, because some do not report a second time that they have arrived") {
  Reading test;
  test.fixture.report(0, ReportedStep::tested);
  CHECK(test.read());
  test.state().nodes[1].lost = true;
  test.state().report().lost.emplace_back(1);
  test.state().nodes[0].received.narrow_done = false;  // as Failover does
  CHECK(test.read());
  CHECK(test.received(0).narrow_done);
  // Without a bit in FrameControl.
  test.fixture.node_contacts(2).report.reached.store(
      {test.state().frame, test.state().map.epoch(), ReportedStep::tested});
  CHECK(test.read());
  CHECK(test.received(2).states);
  CHECK(test.received(2).narrow_done);
  CHECK(!test.read());
}

}  // namespace
}  // namespace ringfence::nodes::test
