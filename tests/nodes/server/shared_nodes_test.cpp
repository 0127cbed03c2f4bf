#include "nodes/server/shared_nodes.hpp"

#include <doctest/doctest.h>

#include "nodes/server/server_fixture.hpp"

namespace ringfence::nodes::test {
namespace {

constexpr FixtureConfig sharing{.placement = Placement::region, .shares_memory = true};

const TrafficReport& traffic(ServerFixture& fixture, Traffic kind) {
  return fixture.state().report().traffic[static_cast<std::size_t>(kind)];
}

TEST_CASE("nodes send each other their objects under a new map only if all connected ones share memory") {
  ServerFixture fixture(sharing);
  const SharedNodes shared(fixture.state());
  CHECK(shared.can_exchange_objects());
  fixture.state().nodes[1].connection.node_contacts = nullptr;
  CHECK(!shared.can_exchange_objects());
  fixture.state().nodes[1].connected = false;
  CHECK(shared.can_exchange_objects());

  ServerFixture with_users({.placement = Placement::region, .shares_memory = true, .interest = 8});
  const SharedNodes publishing(with_users.state());
  CHECK(publishing.can_exchange_objects());
  with_users.state().nodes[0].connection.publication = nullptr;
  CHECK(!publishing.can_exchange_objects());
}

TEST_CASE("a node of another process shares no memory") {
  ServerFixture fixture;
  Statistics statistics(fixture.state());
  SharedNodes shared(fixture.state());
  PeerSession& node = fixture.state().nodes[0];
  CHECK(!SharedNodes::is_shared(node));
  CHECK(SharedNodes::host_of(node) == nullptr);
  CHECK(SharedNodes::kept_states(node) == nullptr);
  CHECK(!SharedNodes::can_publish(node));
  SharedNodes::set_exchange(node, true, true);
  SharedNodes::order_publication(node, true);
  shared.begin_ghosts(true);
  shared.close_ghost_gates();
  CHECK(!shared.is_reading_ghosts());
  CHECK(!shared.receive_contacts(node, statistics));
  shared.count_reads(statistics);
  CHECK(traffic(fixture, Traffic::m2).messages == 0);
}

TEST_CASE("a lost node that reads ghost updates holds the next frame back until it leaves its gate") {
  ServerFixture fixture(sharing);
  SharedNodes shared(fixture.state());
  ReadGate& first = fixture.node_contacts(0).ghost_updates.gate;
  ReadGate& second = fixture.node_contacts(1).ghost_updates.gate;
  shared.begin_ghosts(false);
  CHECK(!first.enter());
  shared.begin_ghosts(true);
  REQUIRE(first.enter());
  CHECK(!shared.is_reading_ghosts());  // it is not lost
  fixture.state().nodes[0].lost = true;
  shared.close_ghost_gates();
  CHECK(!second.enter());
  CHECK(shared.is_reading_ghosts());
  first.leave();
  CHECK(!shared.is_reading_ghosts());
}

TEST_CASE("contacts in shared memory go to the ledger and count like messages") {
  ServerFixture fixture(sharing);
  Statistics statistics(fixture.state());
  SharedNodes shared(fixture.state());
  NodeContacts& contacts = fixture.node_contacts(1);
  contacts.start(1);
  contacts.keys.push_back(base::PairSort::key(1, 2));
  contacts.keys.push_back(base::PairSort::key(1, 3));
  CHECK(shared.receive_contacts(fixture.state().nodes[1], statistics));
  CHECK(fixture.state().ledger.received(1) == 2);
  CHECK(traffic(fixture, Traffic::m3).records == 2);
  CHECK(traffic(fixture, Traffic::m3).bytes == 2 * sizeof(messages::CollisionRecord));
  contacts.taken = 5;
  fixture.node_contacts(0).taken = 7;
  fixture.state().nodes[0].lost = true;
  shared.count_reads(statistics);
  CHECK(traffic(fixture, Traffic::m4).records == 5);
}

TEST_CASE("the server sets how a node receives the contacts and objects of others, and whether it publishes") {
  ServerFixture fixture({.placement = Placement::region, .shares_memory = true, .interest = 8});
  PeerSession& node = fixture.state().nodes[0];
  SharedNodes::set_exchange(node, true, false);
  CHECK(fixture.node_contacts(0).nodes_exchange_contacts);
  CHECK(!fixture.node_contacts(0).hosts_exchange_objects);
  SharedNodes::set_exchange(node, false, true);
  CHECK(!fixture.node_contacts(0).nodes_exchange_contacts);
  CHECK(fixture.node_contacts(0).hosts_exchange_objects);
  SharedNodes::order_publication(node, true);
  CHECK(fixture.publication(0).wanted);
  CHECK(&SharedNodes::published(node) == &fixture.publication(0).published);
}

}  // namespace
}  // namespace ringfence::nodes::test
