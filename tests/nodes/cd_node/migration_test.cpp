#include "nodes/cd_node/migration.hpp"

#include <doctest/doctest.h>

#include "nodes/cd_node/node_fixture.hpp"

namespace ringfence::nodes::test {
namespace {

messages::MessageView hand_over(NodeFixture& fixture, ObjectNumber number) {
  messages::HandOverRecord record;
  record.object = {number, 1, number, messages::flag_present};
  return fixture.message(MessageType::hand_over, record, Endpoint::node(1));
}

struct Migrating {
  explicit Migrating(NodeFixture& fixture) : state(fixture.state()) {
    migration.assign();
    migration.begin();
  }
  NodeState& state;
  Migration migration{state};
};

TEST_CASE("a leaving object is handed over with its whole state and hosted no more") {
  NodeFixture fixture;
  Migrating node(fixture);
  fixture.host(3, {40, 10, 10});
  fixture.host(4, {10, 10, 10});
  node.migration.add(3, 1);
  node.migration.list();
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
  NodeFixture fixture;
  Migrating node(fixture);
  fixture.host(3, {10, 10, 10});
  fixture.host(4, {40, 10, 10});
  std::vector<messages::OwnerRecord> owners(64, messages::OwnerRecord{1, 0});
  node.state.region.receive(fixture.message(MessageType::region_map, std::span<const messages::OwnerRecord>(owners)));
  node.migration.list();
  CHECK(node.migration.send());
  CHECK(node.state.host.size() == 0);
  CHECK(fixture.sent_to_peer().at(0).header.count == 2);
}

TEST_CASE("migration is complete when the announced objects have arrived") {
  NodeFixture fixture;
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
  NodeFixture fixture;
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
  node.migration.list();
  CHECK(node.migration.send());
  CHECK(fixture.sent_to_peer().empty());
  CHECK(node.state.host.find(3) == base::NumberIndex::none);  // the server hosts it
  node.migration.begin();
  CHECK(!node.migration.is_lost(1));
}

TEST_CASE("objects that wait for a ring are dropped if their next host is lost") {
  NodeFixture fixture;
  Migrating node(fixture);
  fixture.host(3, {40, 10, 10});
  node.migration.add(3, 1);
  node.migration.list();
  node.state.stage = CdNodeStage::handing_over;
  node.migration.lose({1, 0, 0, 0});
  CHECK(node.migration.send());
  CHECK(fixture.sent_to_peer().empty());
  CHECK(node.state.host.size() == 0);
}

TEST_CASE("a loss that has the frame detected again keeps the hand-overs") {
  NodeFixture fixture;
  Migrating node(fixture);
  node.migration.expect(1);
  node.migration.lose({1, 1, 1, 0});
  CHECK(node.migration.is_lost(1));
  CHECK(!node.migration.is_complete());
}

}  // namespace
}  // namespace ringfence::nodes::test
