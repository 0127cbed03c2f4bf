#include "nodes/cd_node/node_state.hpp"

#include <doctest/doctest.h>

#include "nodes/cd_node/node_fixture.hpp"

namespace ringfence::nodes::test {
namespace {

TEST_CASE("at the start of a frame nothing has arrived; a node that sweeps waits for no pairs") {
  for (const Placement placement : {Placement::server, Placement::region}) {
    NodeFixture fixture({.placement = placement});
    NodeState& state = fixture.state();
    state.received = {true, true, true};
    state.stats.handed_over = 3;
    state.begin(2);
    CHECK(state.frame == 2);
    CHECK(!state.received.positions);
    CHECK(state.received.pairs == (placement == Placement::region));
    CHECK(!state.received.frame_end);
    CHECK(state.stats.handed_over == 0);
  }
}

TEST_CASE("the contacts of a node are in the memory that it shares with the server, if there is any") {
  NodeFixture sharing;
  CHECK(&sharing.state().contacts != &sharing.state().own_contacts);
  CHECK(sharing.state().contacts.host == &sharing.state().host);
  NodeFixture alone({.shares_memory = false});
  CHECK(&alone.state().contacts == &alone.state().own_contacts);
}

TEST_CASE("a message without records is sent once") {
  NodeFixture fixture;
  messages::RunSender run;
  run.start(0);
  CHECK(fixture.state().send_empty(run, MessageType::published));
  CHECK(fixture.state().send_empty(run, MessageType::published));
  const auto sent = fixture.sent_to_server();
  REQUIRE(sent.size() == 1);
  CHECK(sent[0].type() == MessageType::published);
  CHECK(sent[0].header.frame == 1);
  CHECK(sent[0].header.source == Endpoint::node(0).value);
}

}  // namespace
}  // namespace ringfence::nodes::test
