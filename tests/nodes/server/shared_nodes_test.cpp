#include "nodes/server/shared_nodes.hpp"

#include <array>
#include <cstring>

#include <doctest/doctest.h>

#include "nodes/server/server_fixture.hpp"

namespace ringfence::nodes::test {
namespace {

constexpr FixtureConfig sharing{.placement = Placement::region, .shares_memory = true};

const TrafficReport& traffic(ServerFixture& fixture, Traffic kind) {
  return fixture.state().report().traffic[static_cast<std::size_t>(kind)];
}

TEST_CASE("nodes that sweep send each other their objects under a new map, unless the server must publish these") {
  for (const bool shares_memory : {true, false}) {
    ServerFixture sweeping({.placement = Placement::region, .shares_memory = shares_memory});
    CHECK(SharedNodes(sweeping.state()).can_exchange_objects());
    ServerFixture tested({.placement = Placement::server, .shares_memory = shares_memory});
    CHECK(!SharedNodes(tested.state()).can_exchange_objects());
  }
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
  SharedNodes::order_publication(node, true);
  shared.begin_ghosts(true);
  shared.close_ghost_gates();
  CHECK(!shared.is_reading_ghosts());
  CHECK(!shared.receive_contacts(node, statistics));
  shared.count_reads(statistics);
  CHECK(traffic(fixture, Traffic::m2).records == 0);
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

TEST_CASE("ghost updates are counted in the frames in which nodes exchange them") {
  for (const bool exchanged : {true, false}) {
    ServerFixture fixture(sharing);
    Statistics statistics(fixture.state());
    SharedNodes shared(fixture.state());
    GhostUpdates& updates = fixture.node_contacts(0).ghost_updates;
    updates.start(1);
    updates.add({});
    updates.add_receiver(1, false);
    updates.finish(2);
    shared.begin_ghosts(exchanged);
    shared.count_reads(statistics);
    CHECK(fixture.state().report().ghost_updates == (exchanged ? 1 : 0));
    CHECK(traffic(fixture, Traffic::m2).records == (exchanged ? 1 : 0));
  }
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

TEST_CASE("a node of another process is sent the number of ghosts that other nodes send it, or none") {
  for (const bool exchanged : {true, false}) {
    ServerFixture fixture({.placement = Placement::region});
    SharedNodes shared(fixture.state());
    alignas(8) std::array<std::byte, sizeof(messages::Header) + sizeof(messages::CountRecord)> bytes;
    const messages::CountRecord count{1, 9};
    messages::write_header(bytes.data(), {MessageType::ghost_counts, Endpoint::node(0), Endpoint::server(), 1, 1},
                           sizeof count, 1, true, 1);
    std::memcpy(bytes.data() + sizeof(messages::Header), &count, sizeof count);
    messages::MessageView view;
    REQUIRE(messages::decode(bytes, 0, view) == Status::ok);
    REQUIRE(fixture.state().direct_ghosts.add(0, view));
    shared.begin_ghosts(exchanged);
    for (NodeNumber node = 0; node < 2; ++node) {
      CHECK(shared.send_ghosts(fixture.state().nodes[node]));
      CHECK(shared.send_ghosts(fixture.state().nodes[node]));  // once
      const auto sent = fixture.sent_to(Endpoint::node(node));
      REQUIRE(sent.size() == 1);
      CHECK(sent[0].record<messages::GhostsSentRecord>(0).ghosts == (exchanged && node == 1 ? 9 : 0));
    }
  }
}

TEST_CASE("the server sets whether a node publishes") {
  ServerFixture fixture({.placement = Placement::region, .shares_memory = true, .interest = 8});
  PeerSession& node = fixture.state().nodes[0];
  SharedNodes::order_publication(node, true);
  CHECK(fixture.publication(0).wanted);
  CHECK(&SharedNodes::published(node) == &fixture.publication(0).published);
}

}  // namespace
}  // namespace ringfence::nodes::test
