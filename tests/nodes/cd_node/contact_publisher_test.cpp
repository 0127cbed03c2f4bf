#include "nodes/cd_node/contact_publisher.hpp"

#include <array>

#include <doctest/doctest.h>

#include "nodes/cd_node/node_fixture.hpp"

namespace ringfence::nodes::test {
namespace {

struct Publishing {
  explicit Publishing(NodeFixture& fixture) : state(fixture.state()) {}
  /// Detects and lists the contacts of a frame.
  void list(std::uint64_t frame) {
    state.begin(frame);
    detector.discard();
    detector.test_all();
    detector.finish();
    publisher.list();
  }
  NodeState& state;
  Detector detector{state};
  ContactPublisher publisher{state, detector};
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

TEST_CASE("a node that shares memory sends only that it is done") {
  NodeFixture fixture;
  Publishing node(fixture);
  fixture.know(1, {10, 10, 10});
  fixture.know(2, {10.5, 10, 10});
  node.list(1);
  CHECK(node.publisher.send());
  const auto sent = fixture.sent_to_server();
  REQUIRE(sent.size() == 1);
  CHECK(sent[0].type() == MessageType::narrow_done);
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

TEST_CASE("the node reads the contacts of its objects from its peer if the gate admits it") {
  for (const bool admitted : {false, true}) {
    NodeFixture fixture;
    Publishing node(fixture);
    node.list(1);
    NodeContacts& peer = fixture.peer();
    std::array<narrow_phase::Body, 2> bodies;
    bodies[0].number = 7;
    bodies[1].number = 9;
    const narrow_phase::PairContact touch{0, 0.25f, {}, {}};
    peer.start(1);
    peer.touches = &touch;
    peer.bodies = bodies.data();
    peer.keys.push_back(base::PairSort::key(7, 9));
    peer.found.push_back({0, 0, 0, 1, 0});
    peer.compare([](const FoundContact&) { return true; }, [](std::uint64_t, const FoundContact&) { return true; });
    peer.for_peers.add(0, 0);
    peer.for_peers.finish(2);
    NodeContacts* const all[] = {&node.state.contacts, &peer};
    OutputMerge merge;
    std::array<Contact, 1> contacts;
    std::array<std::uint64_t, 1> keys;
    std::array<Found, 1> finders;
    merge.node_contacts = all;
    merge.contacts = contacts.data();
    merge.keys = keys.data();
    merge.found = finders.data();
    node.state.contacts.output_merge = &merge;
    if (admitted) node.state.contacts.gate.admit();
    node.publisher.finish();
    const auto received = node.state.host.contacts().received(1);
    REQUIRE(received.size() == (admitted ? 1 : 0));
    if (admitted) {
      CHECK(received[0].a == 7);
      CHECK(received[0].b == 9);
      CHECK(received[0].phase == Phase::begin);
      CHECK(contacts[0].depth == 0.25f);  // the slice of the output lists
      CHECK(finders[0].by == 1);
      CHECK(node.state.contacts.taken == 1);
    }
  }
}

Contact contact_of(ObjectNumber a, ObjectNumber b) {
  Contact contact;
  contact.a = a;
  contact.b = b;
  return contact;
}

TEST_CASE("contacts of the server are of the frame before; those of other nodes are of this frame, and are sorted") {
  NodeFixture fixture({.shares_memory = false});
  Publishing node(fixture);
  node.list(1);
  node.publisher.receive_late(fixture.message(MessageType::notify, contact_of(7, 9)));
  CHECK(node.state.host.contacts().received(1).empty());
  node.publisher.expect(3);
  const Contact some[] = {contact_of(8, 9), contact_of(3, 4)};
  node.publisher.receive(fixture.message(MessageType::notify, std::span<const Contact>(some), true, Endpoint::node(1)));
  CHECK(!node.publisher.is_complete());
  node.publisher.receive(fixture.message(MessageType::notify, contact_of(3, 5), Endpoint::node(1)));
  CHECK(node.publisher.is_complete());
  node.publisher.add_received();
  const auto received = node.state.host.contacts().received(1);
  REQUIRE(received.size() == 3);
  CHECK(received[0].b == 4);
  CHECK(received[1].b == 5);
  CHECK(received[2].a == 8);
}

TEST_CASE("contacts of a lost node are not awaited, but those that it has sent count") {
  NodeFixture fixture({.shares_memory = false});
  Publishing node(fixture);
  node.list(1);
  node.publisher.expect(3);
  node.publisher.receive(fixture.message(MessageType::notify, contact_of(3, 5), Endpoint::node(1)));
  CHECK(!node.publisher.is_complete());
  node.publisher.lose({1, 0, 0, 3});
  CHECK(node.publisher.is_complete());
  node.publisher.add_received();
  CHECK(node.state.host.contacts().received(1).size() == 1);
}

}  // namespace
}  // namespace ringfence::nodes::test
