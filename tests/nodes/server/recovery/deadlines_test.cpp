#include "nodes/server/recovery/deadlines.hpp"

#include <doctest/doctest.h>

#include "link/doorbell.hpp"
#include "nodes/server/server_fixture.hpp"

namespace ringfence::nodes::test {
namespace {

constexpr std::uint64_t deadline = 1000;
constexpr std::uint64_t start = 5000;

/// A frame that began at `start`; time is a number of the test.
struct Clock {
  explicit Clock(const FixtureConfig& config) : fixture(config) {
    fixture.state().begin_ns = start;
    for (PeerSession& node : fixture.state().nodes) node.last_received_ns = start;
    deadlines.begin();
    deadlines.begin_moves(start);
  }
  ServerState& state() { return fixture.state(); }
  std::size_t probes(NodeNumber node) {
    std::size_t probes = 0;
    for (const SentMessage& message : fixture.sent_to(Endpoint::node(node))) {
      probes += message.type() == MessageType::probe ? 1 : 0;
    }
    return probes;
  }

  ServerFixture fixture;
  ObjectStates states{fixture.state(), fixture.exchange()};
  StateRelay relay{fixture.state(), fixture.exchange()};
  Statistics statistics{fixture.state()};
  Failover failover{fixture.state(), fixture.exchange(), states, relay, statistics};
  Dispatch dispatch{fixture.state()};
  Deadlines deadlines{fixture.state(), failover, dispatch};
};

TEST_CASE("a silent node is probed once after half of its deadline, and lost after another half without an answer") {
  Clock test({.node_deadline_ns = deadline});
  test.state().stage = FrameStage::moving;
  CHECK(!test.deadlines.check(start + deadline / 2));
  CHECK(test.probes(0) == 0);
  CHECK(!test.deadlines.check(start + deadline / 2 + 1));
  CHECK(!test.deadlines.check(start + deadline));
  CHECK(test.probes(0) == 1);
  test.state().nodes[1].last_received_ns = start + deadline;  // it answers
  test.state().nodes[1].probed_ns = 0;
  CHECK(test.deadlines.check(start + deadline + 2));
  CHECK(test.state().nodes[0].lost);
  CHECK(!test.state().nodes[1].lost);
}

TEST_CASE("without deadlines no role is lost or late") {
  Clock test({});
  test.fixture.connect(0);
  test.state().stage = FrameStage::moving;
  CHECK(!test.deadlines.is_watching());
  CHECK(!test.deadlines.check(start + 1000 * deadline));
  CHECK(test.probes(0) == 0);
  CHECK(test.state().report().late.empty());
}

TEST_CASE("without threads a user node is late if it does not report its moves, publish or acknowledge in time") {
  Clock test({.user_deadline_ns = deadline});
  for (const UserNumber user : {0u, 1u, 2u}) test.fixture.connect(user);
  test.state().stage = FrameStage::starting_nodes;
  CHECK(!test.deadlines.check(start + 2 * deadline));  // the frame has not started for users
  test.state().stage = FrameStage::moving;
  test.state().await_users();
  for (const UserNumber user : {1u, 2u}) test.state().received_from(test.state().users[user]).states = true;
  CHECK(!test.deadlines.check(start + deadline));
  CHECK(test.deadlines.check(start + deadline + 1));
  CHECK(test.state().report().late == std::vector<UserId>{UserId(0)});
  test.state().user_connections[1].published = false;
  CHECK(!test.deadlines.check(start + deadline + 1));
  test.state().stage = FrameStage::colliding;
  CHECK(test.deadlines.check(start + deadline + 1));
  CHECK(test.state().report().late == std::vector<UserId>{UserId(0), UserId(1)});
  test.state().stage = FrameStage::notifying_users;
  test.state().notify_ns = start + 5 * deadline;
  test.state().user_connections[2].frame_done = true;
  CHECK(!test.deadlines.check(start + 6 * deadline + 1));
  test.state().user_connections[2].frame_done = false;
  CHECK(!test.deadlines.check(start + 6 * deadline));
  CHECK(test.deadlines.check(start + 6 * deadline + 1));
  CHECK(test.state().report().late == std::vector<UserId>{UserId(0), UserId(1), UserId(2)});
  CHECK(test.state().report().refused[static_cast<std::size_t>(Status::late)] == 3);
}

TEST_CASE("with threads, the facade is asked once per half deadline who is late, and only those are") {
  Clock test({.user_deadline_ns = deadline});
  link::Doorbell caller, new_thread;
  test.fixture.order().caller = &caller;
  for (const UserNumber user : {0u, 1u}) test.fixture.connect(user);
  test.state().stage = FrameStage::moving;
  CHECK(!test.deadlines.check(start + deadline / 2));
  CHECK(!test.fixture.order().users_overdue);
  CHECK(!test.deadlines.check(start + deadline / 2 + 1));
  CHECK(test.fixture.order().users_overdue.exchange(false));
  CHECK(!test.deadlines.check(start + deadline / 2 + 2));
  CHECK(!test.fixture.order().users_overdue);
  test.fixture.order().stalled_users = {1};
  test.fixture.order().moved_connections = {{test.state().users[0].connection, &new_thread}};
  test.fixture.order().users_moved = true;
  CHECK(test.deadlines.check(start + deadline));
  CHECK(!test.fixture.order().users_moved);
  CHECK(test.state().report().late == std::vector<UserId>{UserId(1)});
}

TEST_CASE("with threads, no user node is late because its thread publishes or acknowledges late") {
  Clock test({.user_deadline_ns = deadline});
  link::Doorbell caller;
  test.fixture.order().caller = &caller;
  for (const UserNumber user : {0u, 1u}) test.fixture.connect(user);
  test.state().await_users();
  for (const UserNumber user : {0u, 1u}) test.state().received_from(test.state().users[user]).states = true;
  for (UserConnection& peers : test.state().user_connections) peers.published = false;
  test.state().notify_ns = start;
  for (const FrameStage stage : {FrameStage::colliding, FrameStage::notifying, FrameStage::notifying_users}) {
    CAPTURE(static_cast<int>(stage));
    test.state().stage = stage;
    CHECK(!test.deadlines.check(start + 100 * deadline));
    CHECK(!test.fixture.order().users_overdue);
  }
  CHECK(test.state().report().late.empty());
}

TEST_CASE("if a thread of a lost node stays inside a read gate, all nodes are lost after a deadline") {
  Clock test({.node_deadline_ns = deadline});
  test.state().ledger.resolve_phases();
  test.state().ledger.share_out();
  test.state().stage = FrameStage::closing;
  test.failover.lose(0);
  test.state().nodes[1].received.frame_done = true;
  test.state().nodes[1].last_received_ns = start + 10 * deadline;
  CHECK(!test.deadlines.check(start + 10 * deadline));
  CHECK(!test.deadlines.check(start + 11 * deadline));
  CHECK(!test.deadlines.has_abandoned_nodes());
  test.state().nodes[1].last_received_ns = start + 11 * deadline;
  CHECK(test.deadlines.check(start + 11 * deadline + 1));
  CHECK(test.deadlines.has_abandoned_nodes());
  CHECK(!test.state().any_active_node());
  CHECK(!test.deadlines.check(start + 20 * deadline));  // once
  test.deadlines.begin();
  CHECK(!test.deadlines.has_abandoned_nodes());
}

}  // namespace
}  // namespace ringfence::nodes::test
