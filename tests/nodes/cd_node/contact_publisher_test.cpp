#include "nodes/cd_node/contact_publisher.hpp"

#include <doctest/doctest.h>

#include "nodes/cd_node/node_fixture.hpp"

namespace ringfence::nodes::test {
namespace {

struct Publishing {
  explicit Publishing(NodeFixture& fixture) : state(fixture.state()), exchange(fixture.exchange()) {}
  /// Detects and lists the contacts of a frame.
  void list(std::uint64_t frame) {
    state.begin(frame);
    detector.discard();
    detector.test_all();
    detector.finish();
    publisher.list();
  }
  NodeState& state;
  NodeExchange& exchange;
  Detector detector{state};
  ContactPublisher publisher{state, detector, exchange};
};

TEST_CASE("a node without shared memory sends its contacts, then those that began and ended, then that it is done") {
  NodeFixture fixture({.shares_memory = false});
  Publishing node(fixture);
  fixture.know(1, {10, 10, 10});
  fixture.know(2, {10.5, 10, 10});
  node.list(1);
  CHECK(node.publisher.send());
  auto sent = fixture.sent_to_server();
  REQUIRE(sent.size() == 3);
  REQUIRE(sent[0].type() == MessageType::collision);
  REQUIRE(sent[0].header.count == 1);
  const auto collision = sent[0].record<messages::CollisionRecord>(0);
  CHECK(collision.slot_a == 1);
  CHECK(collision.slot_b == 2);
  CHECK(collision.depth == doctest::Approx(0.5));
  REQUIRE(sent[1].type() == MessageType::change);
  CHECK(sent[1].record<messages::ChangeRecord>(0).key == base::PairSort::key(1, 2));
  CHECK(sent[1].record<messages::ChangeRecord>(0).flags == messages::change_at_border);  // not known before: in doubt
  REQUIRE(sent[2].type() == MessageType::narrow_done);
  CHECK(sent[2].record<messages::NarrowDoneRecord>(0).contacts == 1);

  node.list(2);
  CHECK(node.publisher.send());
  sent = fixture.sent_to_server();
  REQUIRE(sent.size() == 2);  // nothing changed
  CHECK(sent[1].type() == MessageType::narrow_done);

  fixture.know(2, {20, 10, 10});
  node.list(3);
  CHECK(node.publisher.send());
  sent = fixture.sent_to_server();
  REQUIRE(sent.size() == 3);
  CHECK(sent[0].header.count == 0);
  CHECK(sent[1].record<messages::ChangeRecord>(0).flags == messages::change_ended);
}

TEST_CASE("a node that shares memory sends no contacts, and reports its totals") {
  NodeFixture fixture;
  Publishing node(fixture);
  fixture.know(1, {10, 10, 10});
  fixture.know(2, {10.5, 10, 10});
  node.list(1);
  CHECK(node.publisher.send());
  CHECK(fixture.sent_to_server().empty());
  CHECK(node.state.contacts.report.reached.load().step() == ReportedStep::tested);
  CHECK(node.state.contacts.report.totals.contacts == 1);
  CHECK(node.state.contacts.keys.size() == 1);
}

TEST_CASE("a contact begins unless the server corrects it") {
  NodeFixture fixture({.shares_memory = false});
  Publishing node(fixture);
  fixture.know(1, {10, 10, 10});
  fixture.know(2, {10.5, 10, 10});
  node.list(1);
  CHECK(node.state.contacts.phase(0) == Phase::begin);
  node.publisher.receive_corrections(fixture.message(MessageType::correct, messages::CorrectRecord{0, 0}));
  CHECK(node.state.contacts.phase(0) == Phase::persist);
}

TEST_CASE("a contact is listed for the node and the user that host one of its objects next") {
  NodeFixture fixture;
  Publishing node(fixture);
  fixture.know(1, {31.8, 10, 10});
  fixture.know(2, {32.2, 10, 10});
  fixture.know(3, {10, 10, 10});
  fixture.know(4, {10.5, 10, 10});
  fixture.know(5, {10, 30, 10});
  fixture.know(6, {10.5, 30, 10}, messages::flag_present | messages::flag_avatar);
  node.list(1);
  const NodeContacts& contacts = node.state.contacts;
  REQUIRE(contacts.keys.size() == 3);
  REQUIRE(contacts.for_peers.of(1).size() == 1);
  CHECK(contacts.keys[contacts.for_peers.of(1)[0]] == base::PairSort::key(1, 2));
  REQUIRE(contacts.user_contacts.size() == 1);
  CHECK(contacts.user_contacts[0].key == base::PairSort::key(5, 6));
}

}  // namespace
}  // namespace ringfence::nodes::test
