#include "nodes/exchange/server/server_exchange.hpp"

#include <array>
#include <cstring>
#include <vector>

#include <doctest/doctest.h>

#include "nodes/server/server_fixture.hpp"

namespace ringfence::nodes::test {
namespace {

constexpr FixtureConfig sharing{.placement = Placement::region, .shares_memory = true};

const TrafficReport& traffic(ServerFixture& fixture, Traffic kind) {
  return fixture.state().report().traffic[static_cast<std::size_t>(kind)];
}

void lose(ServerFixture& fixture, NodeNumber node) {
  fixture.state().nodes[node].lost = true;
  fixture.state().report().lost.emplace_back(node);
}

TEST_CASE("a lost node that reads ghost updates holds the next frame back until it leaves its gate") {
  ServerFixture fixture(sharing);
  ServerExchange& exchange = fixture.exchange();
  ReadGate& first = fixture.node_contacts(0).ghost_updates.gate;
  ReadGate& second = fixture.node_contacts(1).ghost_updates.gate;
  exchange.begin_ghosts(false);
  CHECK(!first.enter());
  exchange.begin_ghosts(true);
  REQUIRE(first.enter());
  CHECK(!exchange.is_reading());  // it is not lost
  lose(fixture, 0);
  exchange.close_ghost_gates();
  CHECK(!second.enter());
  CHECK(exchange.is_reading());
  first.leave();
  CHECK(!exchange.is_reading());
}

TEST_CASE("a lost node that reads hand-overs holds the next frame back until it leaves its gate or pauses in it") {
  for (const bool pauses : {false, true}) {
    ServerFixture fixture(sharing);
    ServerExchange& exchange = fixture.exchange();
    ReadGate& gate = fixture.node_contacts(0).hand_over_gate;
    gate.admit();
    REQUIRE(gate.enter());
    CHECK(!exchange.is_reading());  // it is not lost
    lose(fixture, 0);
    CHECK(exchange.is_reading());
    pauses ? gate.pause() : gate.leave();
    CHECK(!exchange.is_reading());
    CHECK(!gate.enter());
  }
}

TEST_CASE("ghost updates are counted in the frames in which nodes exchange them") {
  for (const bool exchanged : {true, false}) {
    ServerFixture fixture(sharing);
    Statistics statistics(fixture.state());
    ServerExchange& exchange = fixture.exchange();
    fixture.node_contacts(0).report.ghosts = 1;
    exchange.begin_ghosts(exchanged);
    exchange.count_records(statistics);
    CHECK(fixture.state().report().ghost_updates == (exchanged ? 1 : 0));
    CHECK(traffic(fixture, Traffic::m2).records == (exchanged ? 1 : 0));
  }
}

TEST_CASE("contacts in shared memory go to the ledger and count like messages") {
  ServerFixture fixture(sharing);
  Statistics statistics(fixture.state());
  ServerExchange& exchange = fixture.exchange();
  NodeContacts& contacts = fixture.node_contacts(1);
  contacts.start(1);
  contacts.keys.push_back(base::PairSort::key(1, 2));
  contacts.keys.push_back(base::PairSort::key(1, 3));
  contacts.summarize();
  exchange.receive_contacts(fixture.state().nodes[1], statistics);
  CHECK(fixture.state().ledger.received(1) == 2);
  CHECK(traffic(fixture, Traffic::m3).records == 2);
  CHECK(traffic(fixture, Traffic::m3).bytes == 2 * sizeof(messages::CollisionRecord));
  contacts.report.taken = 5;
  fixture.node_contacts(0).report.taken = 7;
  exchange.dismiss(fixture.state().nodes[0]);
  exchange.count_records(statistics);
  CHECK(traffic(fixture, Traffic::m4).records == 5);
}

TEST_CASE("within a process the end of the frame is not sent, but counts like the message with what it says") {
  for (const std::uint64_t hand_overs : {0u, 3u}) {
    ServerFixture fixture(sharing);
    PeerSession& node = fixture.state().nodes[1];
    node.hand_overs = hand_overs;
    node.end_run.start(1);
    fixture.exchange().start_end(node, false);
    CHECK(node.end_run.done());
    CHECK(fixture.node_contacts(1).end.hand_overs == hand_overs);
    CHECK(fixture.node_contacts(1).end.hosts_exchange_objects == 0);
    CHECK(fixture.sent_to(Endpoint::node(1)).empty());
    CHECK(traffic(fixture, Traffic::control).messages == 1);
    CHECK(traffic(fixture, Traffic::control).records == (hand_overs != 0 ? 1 : 0));
    fixture.exchange().start_end(node, true);
    CHECK(fixture.node_contacts(1).end.hosts_exchange_objects == 1);
    CHECK(traffic(fixture, Traffic::control).bytes ==
          2 * sizeof(messages::Header) + (hand_overs != 0 ? 2 : 1) * sizeof(messages::FrameEndRecord));
  }
}

TEST_CASE("where no node may be lost, the server reads next hosts in the memory of the nodes") {
  for (const bool may_be_lost : {true, false}) {
    FixtureConfig config = sharing;
    config.nodes = 12;  // more than are prefetched ahead
    config.nodes_may_be_lost = may_be_lost;
    ServerFixture fixture(config);
    const std::array<NextHostOf, 2> first{{{4, 1}, {9, 11}}};
    const std::array<NextHostOf, 1> last{{{7, 0}}};
    fixture.node_contacts(0).report.next_hosts = first;
    fixture.node_contacts(5).report.next_hosts = first;
    fixture.exchange().dismiss(fixture.state().nodes[5]);
    fixture.node_contacts(11).report.next_hosts = last;
    base::FlatList<NextHostOf> listed;
    fixture.exchange().list_next_hosts(listed);
    const std::vector<NextHostOf> all(listed.begin(), listed.end());
    CHECK(all == (may_be_lost ? std::vector<NextHostOf>{} : std::vector<NextHostOf>{{4, 1}, {9, 11}, {7, 0}}));
  }
}

TEST_CASE("a node is sent the number of ghosts that other nodes send it, or none") {
  for (const bool exchanged : {true, false}) {
    ServerFixture fixture({.placement = Placement::region});
    ServerExchange& exchange = fixture.exchange();
    alignas(8) std::array<std::byte, sizeof(messages::Header) + sizeof(messages::CountRecord)> bytes;
    const messages::CountRecord count{1, 9};
    messages::write_header(bytes.data(), {MessageType::ghost_counts, Endpoint::node(0), Endpoint::server(), 1, 1},
                           sizeof count, 1, true, 1);
    std::memcpy(bytes.data() + sizeof(messages::Header), &count, sizeof count);
    messages::MessageView view;
    REQUIRE(messages::decode(bytes, 0, view) == Status::ok);
    REQUIRE(exchange.receive_counts(fixture.state().nodes[0], view));
    exchange.begin_ghosts(exchanged);
    for (NodeNumber node = 0; node < 2; ++node) {
      CHECK(exchange.send_ghosts(fixture.state().nodes[node]));
      CHECK(exchange.send_ghosts(fixture.state().nodes[node]));  // once
      const auto sent = fixture.sent_to(Endpoint::node(node));
      REQUIRE(sent.size() == 1);
      CHECK(sent[0].record<messages::GhostsSentRecord>(0).ghosts == (exchanged && node == 1 ? 9 : 0));
    }
  }
}

}  // namespace
}  // namespace ringfence::nodes::test
