#include "nodes/server/frame/report_reader.hpp"

#include <doctest/doctest.h>

#include "nodes/server/server_fixture.hpp"

namespace ringfence::nodes::test {
namespace {

struct Reading {
  explicit Reading(bool nodes_may_be_lost = true)
      : fixture({.nodes = 3, .shares_memory = true, .nodes_may_be_lost = nodes_may_be_lost}) {
    state().stage = FrameStage::colliding;
    reader.begin();
  }
  ServerState& state() { return fixture.state(); }
  bool read() {
    reader.look();
    return reader.accept();
  }
  const PeerSession::Received& received(NodeNumber node) { return state().nodes[node].received; }

  ServerFixture fixture;
  ObjectStates states{fixture.state(), fixture.exchange()};
  Statistics statistics{fixture.state()};
  NodeResults results{fixture.state(), fixture.exchange(), states, statistics};
  ReportReader reader{fixture.state(), results, statistics};
};

TEST_CASE("a step is complete when all nodes have reported it") {
  for (const bool nodes_may_be_lost : {true, false}) {
    CAPTURE(nodes_may_be_lost);
    Reading test(nodes_may_be_lost);
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
}

TEST_CASE("where no node may be lost, a node without states counts as one that has sent an empty message") {
  Reading test(false);
  const auto sent = [&] { return test.state().report().traffic[static_cast<std::size_t>(Traffic::state)].messages; };
  test.state().state_senders = 1;  // node 1, whose messages were counted
  for (const NodeNumber node : {0u, 1u, 2u}) {
    CHECK(sent() == 0);
    test.fixture.report(node, ReportedStep::moved);
    test.reader.look();
    CHECK(!test.reader.all(ReportedStep::moved));  // the messages that were sent before have not been read
    CHECK(test.reader.accept());
  }
  CHECK(test.reader.all(ReportedStep::moved));
  CHECK(sent() == 2);
  test.fixture.report(2, ReportedStep::published);
  CHECK(test.read());
  CHECK(!test.read());
  CHECK(!test.reader.all(ReportedStep::published));
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
