#include "nodes/server/frame/node_ingest.hpp"

#include <doctest/doctest.h>

#include "nodes/server/frame/receiver.hpp"

namespace ringfence::nodes::test {
namespace {

TEST_CASE("results count only under the current map, and as a whole") {
  Receiver test;
  test.state().stage = FrameStage::colliding;
  const std::uint32_t a = test.fixture.add({1, 1, 1}, Endpoint::node(0));
  const std::uint32_t b = test.fixture.add({1.5, 1, 1}, Endpoint::node(0));
  messages::CollisionRecord contact;
  contact.slot_a = a;
  contact.slot_b = b;
  test.fixture.send(Endpoint::node(0), MessageType::collision, contact);
  regions::RegionMap& map = test.state().map;
  const std::vector<std::uint32_t> table(map.table().begin(), map.table().end());
  map.assign(table, 2, map.epoch() + 1);
  test.nodes.receive();
  CHECK(test.state().ledger.received(0) == 0);
  test.fixture.send(Endpoint::node(0), MessageType::collision, contact);
  test.fixture.send(Endpoint::node(0), MessageType::narrow_done, messages::NarrowDoneRecord{1, 1, 0, 1, 0});
  test.fixture.send(Endpoint::node(1), MessageType::narrow_done, messages::NarrowDoneRecord{3, 1, 2, 1, 0});
  test.nodes.receive();
  CHECK(test.state().ledger.received(0) == 1);
  CHECK(test.state().report().tested == 2);
  CHECK(test.state().report().carried == 2);
  CHECK(test.state().report().accepted == 1);  // node 1 announced a contact that it has not sent
  CHECK(test.refused(Status::bad_message) == 1);
  CHECK(test.state().nodes[0].received.narrow_done);
}

TEST_CASE("a node of another process that breaks the protocol is broken, one that shares memory is trusted") {
  for (const bool shares : {false, true}) {
    CAPTURE(shares);
    Receiver test({.shares_memory = shares});
    test.fixture.send(Endpoint::node(1), MessageType::frame_done, messages::NodeFrameStats{});  // too early
    test.nodes.receive();
    CHECK(test.refused(Status::bad_message) == 1);
    CHECK(test.state().nodes[1].broken == !shares);
    CHECK(test.nodes.take_broken() == !shares);
    CHECK(!test.nodes.take_broken());
  }
}

TEST_CASE("the end of a frame is accepted once, after the contacts were sent") {
  Receiver test;
  test.state().stage = FrameStage::closing;
  messages::NodeFrameStats stats;
  stats.hosted = 4;
  test.state().nodes[0].end_run.start(1);
  test.fixture.send(Endpoint::node(0), MessageType::frame_done, stats);
  test.nodes.receive();
  CHECK(!test.state().nodes[0].received.frame_done);
  CHECK(test.refused(Status::bad_message) == 1);
  test.fixture.send(Endpoint::node(1), MessageType::frame_done, stats);
  test.fixture.send(Endpoint::node(1), MessageType::frame_done, stats);
  test.nodes.receive();
  CHECK(test.state().nodes[1].received.frame_done);
  CHECK(test.state().report().nodes[1].hosted == 4);
  CHECK(test.refused(Status::bad_message) == 2);
}

TEST_CASE("what a node of this process reports is accepted once, and counts like the messages that it replaces") {
  Receiver test({.shares_memory = true, .interest = 8});
  test.fixture.publication(0).wanted = true;
  NodeContacts& contacts = test.fixture.node_contacts(0);
  const PeerSession::Received& received = test.state().nodes[0].received;
  CHECK(!test.nodes.receive());
  test.fixture.report(0, ReportedStep::moved);
  CHECK(test.nodes.receive());
  CHECK(received.states);
  CHECK(!received.published);
  CHECK(!test.nodes.receive());

  contacts.report.totals = {.candidates = 5, .tested = 3, .carried = 2, .contacts = 0};
  test.state().stage = FrameStage::colliding;
  test.fixture.report(0, ReportedStep::published);
  test.fixture.report(0, ReportedStep::tested);
  CHECK(test.nodes.receive());
  CHECK(received.published);
  CHECK(received.narrow_done);
  CHECK(test.state().report().accepted == 5);

  const messages::KindRecord kind{.candidates = 3, .timed = 1, .nanoseconds = 70};
  contacts.report.kinds = std::span(&kind, 1);
  contacts.report.stats.hosted = 4;
  contacts.report.stats.host_owned_changes = 3;
  test.fixture.report(0, ReportedStep::done);
  test.nodes.receive();
  CHECK(!received.frame_done);  // the contacts are not final
  test.state().stage = FrameStage::notifying_users;
  test.fixture.node_contacts(1).report.kinds = std::span(&kind, 1);
  test.state().nodes[1].lost = true;
  test.fixture.exchange().dismiss(test.state().nodes[1]);
  test.nodes.count_kinds();
  test.state().stage = FrameStage::closing;
  for (int times = 0; times < 2; ++times) test.nodes.receive();
  CHECK(received.frame_done);
  CHECK(!test.state().nodes[1].received.states);
  CHECK(test.state().report().nodes[0].hosted == 4);
  CHECK(test.states.moved() == 3);
  REQUIRE(test.state().report().kinds.size() == 1);
  CHECK(test.state().report().kinds[0].candidates == 3);  // not those of the lost node
  CHECK(test.state().report().kinds[0].nanoseconds == 70);
  const TrafficReport& control = test.state().report().traffic[static_cast<std::size_t>(Traffic::control)];
  CHECK(control.messages == 4);  // published, narrow_done, kinds, frame_done
  CHECK(control.bytes ==
        4 * sizeof(messages::Header) + sizeof contacts.report.totals + sizeof kind + sizeof contacts.report.stats);
}

TEST_CASE("tests under an earlier map, reports of an earlier frame and those of a lost node are void") {
  Receiver test({.shares_memory = true});
  test.state().stage = FrameStage::colliding;
  ++test.state().frame;
  test.fixture.report(1, ReportedStep::tested);
  --test.state().frame;
  test.fixture.report(0, ReportedStep::tested);
  regions::RegionMap& map = test.state().map;
  const std::vector<std::uint32_t> table(map.table().begin(), map.table().end());
  map.assign(table, 2, map.epoch() + 1);
  CHECK(!test.nodes.receive());
  CHECK(!test.state().nodes[0].received.narrow_done);
  CHECK(!test.state().nodes[1].received.narrow_done);
  // The bits of the first reports remain, so the second ones are found although no bit is new.
  test.fixture.report(0, ReportedStep::tested);
  test.fixture.report(1, ReportedStep::tested);
  test.state().nodes[1].lost = true;
  CHECK(test.nodes.receive());
  CHECK(test.state().nodes[0].received.narrow_done);
  CHECK(!test.state().nodes[1].received.narrow_done);
}

TEST_CASE("messages of a lost node are refused as late") {
  Receiver test;
  test.state().nodes[0].lost = true;
  const std::uint32_t slot = test.fixture.add({1, 1, 1}, Endpoint::node(0));
  test.fixture.send(Endpoint::node(0), MessageType::node_state, test.node_record(slot, {2, 1, 1}, 0));
  CHECK(!test.nodes.receive());
  CHECK(test.nodes.refuse_lost());
  CHECK(!test.nodes.refuse_lost());
  CHECK(test.refused(Status::late) == 1);
  CHECK(test.objects().row(slot).pose.position.x == 1);
}

}  // namespace
}  // namespace ringfence::nodes::test
