#include "nodes/cd_node/migration.hpp"

#include <cstddef>
#include <initializer_list>
#include <vector>

#include <doctest/doctest.h>

#include "nodes/cd_node/node_fixture.hpp"

namespace ringfence::nodes::test {
namespace {

constexpr NodeFixtureConfig by_messages{.shares_memory = false};

messages::HandOverRecord object(ObjectNumber number, const Vec3d& position = {}) {
  messages::HandOverRecord record;
  record.object = {number, 1, number, messages::flag_present};
  record.pose.position = position;
  return record;
}

messages::MessageView hand_over(NodeFixture& fixture, ObjectNumber number) {
  return fixture.message(MessageType::hand_over, object(number), Endpoint::node(1));
}

struct Migrating {
  explicit Migrating(NodeFixture& fixture) : state(fixture.state()), migration(fixture.state(), fixture.exchange()) {
    migration.begin();
  }
  NodeState& state;
  Migration migration;
};

/// Lets the other node list these objects for node 0, under that map.
void list(NodeFixture& fixture, std::uint32_t epoch, std::initializer_list<ObjectNumber> numbers) {
  HandOverList& of_peer = fixture.peer().hand_overs;
  of_peer.start(0);
  const std::byte no_state{};
  for (const ObjectNumber number : numbers) {
    of_peer.add(0, object(number), &no_state);
  }
  of_peer.finish(2, fixture.state().frame, epoch);
  fixture.state().contacts.hand_over_senders.add(1);
}

TEST_CASE("a leaving object is handed over with its whole state and hosted no more") {
  NodeFixture fixture(by_messages);
  Migrating node(fixture);
  fixture.host(3, {40, 10, 10});
  fixture.host(4, {10, 10, 10});
  node.migration.add(3, 1);
  node.migration.start();
  CHECK(node.migration.send());
  const auto sent = fixture.sent_to_peer();
  REQUIRE(sent.size() == 1);
  REQUIRE(sent[0].header.count == 1);
  const auto record = sent[0].record<messages::HandOverRecord>(0);
  CHECK(record.object.number == 3);
  CHECK(record.pose.position.x == 40);
  CHECK(node.state.host.size() == 1);
  CHECK(node.state.host.find(4) != base::NumberIndex::none);
  CHECK(node.state.stats.handed_over == 1);
}

TEST_CASE("under a new map all objects outside of the region are handed over") {
  NodeFixture fixture(by_messages);
  Migrating node(fixture);
  fixture.host(3, {10, 10, 10});
  fixture.host(4, {40, 10, 10});
  std::vector<messages::OwnerRecord> owners(64, messages::OwnerRecord{1, 0});
  node.state.region.receive(fixture.message(MessageType::region_map, std::span<const messages::OwnerRecord>(owners)));
  node.migration.start();
  CHECK(node.migration.send());
  CHECK(node.state.host.size() == 0);
  CHECK(fixture.sent_to_peer().at(0).header.count == 2);
}

TEST_CASE("migration is complete when the announced objects have arrived") {
  NodeFixture fixture(by_messages);
  Migrating node(fixture);
  node.migration.expect(2);
  CHECK(!node.migration.is_complete());
  node.migration.receive(hand_over(fixture, 5));
  CHECK(!node.migration.is_complete());
  node.migration.receive(hand_over(fixture, 6));
  CHECK(node.migration.is_complete());
  CHECK(node.state.host.size() == 2);
}

TEST_CASE("nothing is exchanged with a lost peer any more") {
  NodeFixture fixture(by_messages);
  Migrating node(fixture);
  fixture.host(3, {40, 10, 10});
  node.migration.add(3, 1);
  node.migration.expect(2);
  node.migration.receive(hand_over(fixture, 5));
  CHECK(!node.migration.is_lost(1));
  node.migration.lose({1, 0, 2, 0});
  CHECK(node.migration.is_lost(1));
  CHECK(node.migration.is_complete());
  node.migration.receive(hand_over(fixture, 6));
  CHECK(node.state.host.find(6) == base::NumberIndex::none);
  node.migration.start();
  CHECK(node.migration.send());
  CHECK(fixture.sent_to_peer().empty());
  CHECK(node.state.host.find(3) == base::NumberIndex::none);  // the server hosts it
  node.migration.begin();
  CHECK(!node.migration.is_lost(1));
}

TEST_CASE("objects that wait for a ring are dropped if their next host is lost") {
  NodeFixture fixture(by_messages);
  Migrating node(fixture);
  fixture.host(3, {40, 10, 10});
  node.migration.add(3, 1);
  node.migration.start();
  node.migration.lose({1, 0, 0, 0});
  fixture.exchange().lose({1, 0, 0, 0});
  CHECK(node.migration.send());
  CHECK(fixture.sent_to_peer().empty());
  CHECK(node.state.host.size() == 0);
}

TEST_CASE("a loss that has the frame detected again keeps the hand-overs") {
  NodeFixture fixture(by_messages);
  Migrating node(fixture);
  node.migration.expect(1);
  node.migration.lose({1, 1, 1, 0});
  CHECK(node.migration.is_lost(1));
  CHECK(!node.migration.is_complete());
}

TEST_CASE("the next host reads a leaving object in place, and the node hosts it until the frame ends") {
  NodeFixture fixture;
  Migrating node(fixture);
  fixture.host(3, {40, 10, 10});
  fixture.host(4, {10, 10, 10});
  node.migration.add(3, 1);
  node.migration.list();
  const HandOverList& listed = node.state.contacts.hand_overs;
  const std::uint32_t epoch = node.state.region.map().epoch();
  CHECK(listed.is_for(1, epoch));
  CHECK(!listed.is_for(1, epoch + 1));
  CHECK(!listed.is_for(2, epoch));
  REQUIRE(listed.of(1).size() == 1);
  CHECK(listed.of(0).empty());
  CHECK(listed.record(listed.of(1)[0]).object.number == 3);
  CHECK(listed.record(listed.of(1)[0]).pose.position.x == 40);
  std::vector<NodeNumber> senders;
  fixture.peer().hand_over_senders.take([&](NodeNumber sender) { senders.push_back(sender); });
  CHECK(senders == std::vector<NodeNumber>{0});
  CHECK(node.state.host.size() == 2);
  node.migration.start();
  CHECK(node.migration.send());
  CHECK(node.state.host.size() == 1);
  CHECK(node.state.host.find(4) != base::NumberIndex::none);
  CHECK(node.state.stats.handed_over == 1);
}

TEST_CASE("if a new map comes with the end of the frame, the objects are listed again") {
  NodeFixture fixture;
  Migrating node(fixture);
  fixture.host(3, {40, 10, 10});
  fixture.host(4, {10, 10, 10});
  node.migration.add(3, 1);
  node.migration.list();
  std::vector<messages::OwnerRecord> owners(64, messages::OwnerRecord{1, 0});
  node.state.region.receive(fixture.message(MessageType::region_map, std::span<const messages::OwnerRecord>(owners)));
  node.state.received.frame_end = true;
  node.migration.start();
  const HandOverList& listed = node.state.contacts.hand_overs;
  CHECK(listed.is_for(1, node.state.region.map().epoch()));
  CHECK(listed.of(1).size() == 2);
  CHECK(node.state.host.size() == 0);
}

TEST_CASE("listed objects are taken over once, when their list is for this map and the gate admits the node") {
  NodeFixture fixture;
  Migrating node(fixture);
  const std::uint32_t epoch = node.state.region.map().epoch();
  node.migration.expect(1);
  list(fixture, epoch, {5, 6});
  node.migration.receive_listed();
  CHECK(node.state.host.size() == 0);  // the gate is closed
  node.state.contacts.hand_over_gate.admit();
  list(fixture, epoch - 1, {7});
  node.migration.receive_listed();
  CHECK(!node.migration.is_complete());
  list(fixture, epoch, {5});
  node.migration.receive_listed();
  CHECK(node.migration.is_complete());
  node.migration.expect(1);
  list(fixture, epoch, {5});  // a second hint
  node.migration.receive_listed();
  CHECK(!node.migration.is_complete());
  CHECK(node.state.host.size() == 1);
}

TEST_CASE("what a lost node has listed is void") {
  NodeFixture fixture;
  Migrating node(fixture);
  node.migration.expect(2);
  node.state.contacts.hand_over_gate.admit();
  node.migration.lose({1, 0, 2, 0});
  CHECK(node.migration.is_complete());
  list(fixture, node.state.region.map().epoch(), {5, 6});
  node.migration.receive_listed();
  CHECK(node.state.host.size() == 0);
}

TEST_CASE("a loss may be known before the number of hand-overs") {
  NodeFixture fixture;
  Migrating node(fixture);
  node.migration.lose({1, 0, 2, 0});
  node.migration.expect(2);
  CHECK(node.migration.is_complete());
}

}  // namespace
}  // namespace ringfence::nodes::test
