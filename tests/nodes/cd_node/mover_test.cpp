#include "nodes/cd_node/mover.hpp"

#include <set>

#include <doctest/doctest.h>

#include "nodes/cd_node/node_fixture.hpp"

namespace ringfence::nodes::test {
namespace {

/// A mover with the parts to which it passes what has moved.
struct Moving {
  explicit Moving(NodeFixture& fixture)
      : state(fixture.state()), exchange(fixture.exchange()), halo(state), migration(state, exchange) {
    halo.assign();
    migration.assign();
  }
  void run(std::uint64_t frame) {
    state.frame = frame;
    mover.begin();
    REQUIRE(mover.move());
    REQUIRE(mover.done());
  }
  NodeState& state;
  NodeExchange& exchange;
  HaloExchange halo;
  Migration migration;
  Mover mover{state, exchange, halo, migration};
};

std::vector<messages::NodeStateRecord> reports(NodeFixture& fixture) {
  std::vector<messages::NodeStateRecord> records;
  for (const LoggedMessage& message : fixture.sent_to_server()) {
    for (std::size_t i = 0; message.type() == MessageType::node_state && i < message.header.count; ++i) {
      records.push_back(message.record<messages::NodeStateRecord>(i));
    }
  }
  return records;
}

TEST_CASE("a moved object is in the node's region and in its report, with the bounds of its new pose") {
  NodeFixture fixture({.shares_memory = false});
  Moving moving(fixture);
  fixture.host(3, {10, 10, 10});
  moving.run(1);
  const auto sent = reports(fixture);
  REQUIRE(sent.size() == 1);
  CHECK(sent[0].object.number == 3);
  CHECK(sent[0].pose.position.x == 11);
  CHECK(sent[0].bounds == fixture.bounds({11, 10, 10}));
  CHECK(sent[0].object.flags ==
        (messages::flag_present | messages::flag_interior | messages::flag_keeps_host | messages::flag_host_owned));
  const std::uint32_t known = moving.state.objects.find(3);
  REQUIRE(known != RegionObjects::none);
  CHECK(moving.state.objects.inner(known));
  CHECK(moving.state.objects.bodies()[known].pose.position.x == 11);
  CHECK(moving.state.objects.next_host(known) == NextHost::self);
}

TEST_CASE("an object that crosses the border is handed over") {
  NodeFixture fixture({.shares_memory = false});
  Moving moving(fixture);
  fixture.host(3, {31.2, 10, 10});
  moving.run(1);
  const auto sent = reports(fixture);
  REQUIRE(sent.size() == 1);
  CHECK(sent[0].object.flags == (messages::flag_present | messages::flag_host_owned));
  const std::uint32_t known = moving.state.objects.find(3);  // its bounds still touch the region
  REQUIRE(known != RegionObjects::none);
  CHECK(moving.state.objects.next_host(known) == NextHost::node);
  moving.migration.start();
  CHECK(moving.migration.send());
  CHECK(fixture.sent_to_peer().size() == 1);
  CHECK(moving.state.host.size() == 0);
}

TEST_CASE("the server receives a host-owned state when it appears and when it comes to rest") {
  NodeFixture fixture;
  Moving moving(fixture);
  fixture.host(3, {10, 10, 10});
  moving.run(1);
  const auto first = reports(fixture);
  REQUIRE(first.size() == 1);
  CHECK((first[0].object.flags & messages::flag_host_owned) != 0);
  moving.run(2);
  CHECK(reports(fixture).empty());
  CHECK(moving.state.stats.host_owned_changes == 1);
  const auto kept = moving.state.contacts.host_states.of(2);
  REQUIRE(kept.size() == 1);
  CHECK(kept[0].pose.position.x == 12);
  fixture.rest();
  moving.run(3);
  const auto rest = reports(fixture);
  REQUIRE(rest.size() == 1);
  CHECK((rest[0].object.flags & messages::flag_at_rest) != 0);
}

TEST_CASE("an object at rest stays host-owned if no node can be lost or the server has its state as a replica") {
  for (const bool shares_memory : {true, false}) {
    CAPTURE(shares_memory);
    NodeFixture fixture({.shares_memory = shares_memory, .may_be_lost = !shares_memory});
    Moving moving(fixture);
    const std::uint32_t hosted = fixture.host(3, {10, 10, 10});
    moving.run(1);
    CHECK(reports(fixture).size() == 1);
    fixture.rest();
    for (std::uint64_t frame = 2; frame < 5; ++frame) {
      moving.run(frame);
      CHECK(reports(fixture).empty());
      CHECK(moving.state.stats.host_owned_changes == 0);
      CHECK((moving.state.host[hosted].object.flags & messages::flag_host_owned) != 0);
    }
  }
}

TEST_CASE("a host-owned object at the border is also sent to the peer") {
  NodeFixture fixture;
  Moving moving(fixture);
  fixture.host(3, {29.7, 10, 10});
  moving.run(1);
  moving.run(2);
  base::FlatList<GhostUpdates::Update> updates;
  moving.state.contacts.ghost_updates.list(1, updates);
  REQUIRE(updates.size() == 1);
  CHECK(updates[0].record->pose.position.x == doctest::Approx(31.7));
  CHECK(!updates[0].gone);
}

TEST_CASE("a move that a full ring interrupts reports every object once") {
  NodeFixture fixture({.shares_memory = false, .ring_bytes = 4096});
  Moving moving(fixture);
  constexpr ObjectNumber count = 200;
  for (ObjectNumber number = 1; number <= count; ++number) {
    fixture.host(number, {1.0 + number % 20, 1.0 + number / 20, 10});
  }
  moving.mover.begin();
  std::multiset<ObjectNumber> numbers;
  int waits = 0;
  for (bool done = false; !done;) {
    done = moving.mover.move();
    waits += done ? 0 : 1;
    for (const auto& record : reports(fixture)) numbers.insert(record.object.number);
  }
  CHECK(waits > 0);
  CHECK(numbers.size() == count);
  CHECK(std::set<ObjectNumber>(numbers.begin(), numbers.end()).size() == count);
}

TEST_CASE("hosted objects are published if the server wants it") {
  for (const bool wanted : {false, true}) {
    NodeFixture fixture;
    Moving moving(fixture);
    fixture.publication().wanted = wanted;
    fixture.host(3, {10, 10, 10});
    moving.run(1);
    moving.mover.publish();
    CHECK(fixture.publication().published.any[1] == wanted);
    const FrameMark<ReportedStep> reached = fixture.state().contacts.report.reached.load();
    CHECK(reached.is_of(1));
    CHECK(reached.step() == (wanted ? ReportedStep::published : ReportedStep::moved));
  }
}

}  // namespace
}  // namespace ringfence::nodes::test
