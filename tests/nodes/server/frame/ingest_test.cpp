#include "nodes/server/frame/ingest.hpp"

#include <limits>

#include <doctest/doctest.h>

#include "nodes/server/server_fixture.hpp"

namespace ringfence::nodes::test {
namespace {

struct Receiver {
  explicit Receiver(const FixtureConfig& config = {}) : fixture(config) { state().stage = FrameStage::moving; }
  ServerState& state() { return fixture.state(); }
  ObjectTable& objects() { return fixture.state().objects; }
  void await(UserNumber user) {
    fixture.connect(user);
    state().await_users();
  }
  messages::StateRecord record(std::uint32_t slot, const Vec3d& position) {
    messages::StateRecord record;
    record.object = objects().row(slot).object;
    record.pose.position = position;
    return record;
  }
  messages::NodeStateRecord node_record(std::uint32_t slot, const Vec3d& position, std::uint32_t flags) {
    messages::NodeStateRecord record;
    record.object = objects().row(slot).object;
    record.object.flags |= flags;
    record.pose.position = position;
    record.bounds = state().setup.shapes->bounds(0, record.pose, *state().setup.space);
    return record;
  }
  std::uint64_t refused(Status reason) { return state().report().refused[static_cast<std::size_t>(reason)]; }

  ServerFixture fixture;
  ObjectStates states{fixture.state(), fixture.exchange()};
  Statistics statistics{fixture.state()};
  Ingest ingest{fixture.state(), fixture.exchange(), states, statistics};
};

TEST_CASE("a user node moves the objects that it hosts, and its other records are refused and reported to it") {
  Receiver test;
  test.await(0);
  const std::uint32_t own = test.fixture.add({1, 1, 1}, Endpoint::user(0), Category::avatar);
  const std::uint32_t other = test.fixture.add({2, 1, 1}, Endpoint::node(0));
  messages::StateRecord stale = test.record(own, {9, 9, 9});
  ++stale.object.generation;
  messages::StateRecord infinite = test.record(own, {9, 9, std::numeric_limits<double>::infinity()});
  const std::vector<messages::StateRecord> records{test.record(own, {5, 1, 1}), test.record(other, {9, 9, 9}), stale,
                                                   infinite};
  test.fixture.send<messages::StateRecord>(Endpoint::user(0), MessageType::state_update, std::span(records));
  CHECK(test.ingest.receive());
  CHECK(test.objects().row(own).pose.position == Vec3d{5, 1, 1});
  CHECK(test.objects().row(other).pose.position == Vec3d{2, 1, 1});
  CHECK(test.refused(Status::not_host) == 1);
  CHECK(test.refused(Status::stale_object) == 1);
  CHECK(test.refused(Status::not_finite) == 1);
  CHECK(test.state().users[0].received.refusals.size() == 3);
  CHECK(test.state().users[0].received.states);
  CHECK(test.state().awaited_users == 0);
}

TEST_CASE("after a user's last states its poses are final, and nothing is read until it is awaited again") {
  Receiver test;
  test.await(0);
  const std::uint32_t own = test.fixture.add({1, 1, 1}, Endpoint::user(0), Category::avatar);
  test.fixture.send(Endpoint::user(0), MessageType::state_update, test.record(own, {5, 1, 1}));
  test.ingest.receive();
  test.fixture.send(Endpoint::user(0), MessageType::state_update, test.record(own, {6, 1, 1}));
  CHECK(!test.ingest.receive());
  test.state().awaited_users = 1;  // another user
  CHECK(test.ingest.receive());
  CHECK(test.refused(Status::bad_message) == 1);
  CHECK(test.objects().row(own).pose.position.x == 5);
}

TEST_CASE("records and bytes of a user above its quotas are refused, but the end of its states counts") {
  Receiver records({.quotas = {.updates = 1}});
  records.await(0);
  const std::uint32_t own = records.fixture.add({1, 1, 1}, Endpoint::user(0), Category::avatar);
  const std::vector<messages::StateRecord> two{records.record(own, {5, 1, 1}), records.record(own, {6, 1, 1})};
  records.fixture.send<messages::StateRecord>(Endpoint::user(0), MessageType::state_update, std::span(two));
  records.ingest.receive();
  CHECK(records.objects().row(own).pose.position.x == 5);
  CHECK(records.refused(Status::over_quota) == 1);

  Receiver bytes({.quotas = {.bytes = 10}});
  bytes.await(0);
  const std::uint32_t slot = bytes.fixture.add({1, 1, 1}, Endpoint::user(0), Category::avatar);
  bytes.fixture.send(Endpoint::user(0), MessageType::state_update, bytes.record(slot, {5, 1, 1}));
  bytes.ingest.receive();
  CHECK(bytes.objects().row(slot).pose.position.x == 1);
  CHECK(bytes.refused(Status::over_quota) == 1);
  CHECK(bytes.state().users[0].received.states);
}

TEST_CASE("a node reports the states of its objects and which of them leave its region") {
  Receiver test;
  const std::uint32_t inner = test.fixture.add({1, 1, 1}, Endpoint::node(0));
  const std::uint32_t leaver = test.fixture.add({31, 1, 1}, Endpoint::node(0));
  const std::uint32_t foreign = test.fixture.add({60, 1, 1}, Endpoint::node(1));
  test.objects().settle();
  constexpr std::uint32_t at_home = messages::flag_interior | messages::flag_keeps_host;
  const std::vector<messages::NodeStateRecord> records{test.node_record(inner, {2, 1, 1}, at_home),
                                                       test.node_record(leaver, {33, 1, 1}, 0),
                                                       test.node_record(foreign, {61, 1, 1}, at_home)};
  test.fixture.send<messages::NodeStateRecord>(Endpoint::node(0), MessageType::node_state, std::span(records));
  CHECK(test.ingest.receive());
  CHECK(test.objects().row(inner).pose.position.x == 2);
  CHECK((test.objects().marks(inner) & inner_mark) != 0);
  CHECK(test.objects().row(leaver).pose.position.x == 33);
  CHECK(test.state().leaving_slots == std::vector<std::uint32_t>{leaver});
  CHECK(test.objects().row(foreign).pose.position.x == 60);
  CHECK(test.refused(Status::not_host) == 1);
  CHECK(test.objects().unnotified().size() == 1);  // only the node needs to know the inner one
  CHECK(test.states.moved() == 2);
  CHECK(test.state().nodes[0].received.states);
}

TEST_CASE("results count only under the current map, and as a whole") {
  Receiver test;
  test.state().stage = FrameStage::colliding;
  const std::uint32_t a = test.fixture.add({1, 1, 1}, Endpoint::node(0));
  const std::uint32_t b = test.fixture.add({1.5, 1, 1}, Endpoint::node(0));
  messages::CollisionRecord contact;
  contact.slot_a = a;
  contact.slot_b = b;
  test.fixture.send(Endpoint::node(0), MessageType::collision, contact);
  regions::RegionMap& map = test.state().map;
  const std::vector<std::uint32_t> table(map.table().begin(), map.table().end());
  map.assign(table, 2, map.epoch() + 1);
  test.ingest.receive();
  CHECK(test.state().ledger.received(0) == 0);
  test.fixture.send(Endpoint::node(0), MessageType::collision, contact);
  test.fixture.send(Endpoint::node(0), MessageType::narrow_done, messages::NarrowDoneRecord{1, 1, 0, 1, 0});
  test.fixture.send(Endpoint::node(1), MessageType::narrow_done, messages::NarrowDoneRecord{3, 1, 2, 1, 0});
  test.ingest.receive();
  CHECK(test.state().ledger.received(0) == 1);
  CHECK(test.state().report().tested == 2);
  CHECK(test.state().report().carried == 2);
  CHECK(test.state().report().accepted == 1);  // node 1 announced a contact that it has not sent
  CHECK(test.refused(Status::bad_message) == 1);
  CHECK(test.state().nodes[0].received.narrow_done);
}

TEST_CASE("a node of another process that breaks the protocol is broken, one that shares memory is trusted") {
  for (const bool shares : {false, true}) {
    CAPTURE(shares);
    Receiver test({.shares_memory = shares});
    test.fixture.send(Endpoint::node(1), MessageType::frame_done, messages::NodeFrameStats{});  // too early
    test.ingest.receive();
    CHECK(test.refused(Status::bad_message) == 1);
    CHECK(test.state().nodes[1].broken == !shares);
    CHECK(test.ingest.take_broken() == !shares);
    CHECK(!test.ingest.take_broken());
  }
}

TEST_CASE("a replica of a host-owned object replaces its pose; any other one breaks the protocol") {
  Receiver test({.placement = Placement::region});
  const std::uint32_t owned = test.fixture.add({1, 1, 1}, Endpoint::node(0));
  const std::uint32_t reported = test.fixture.add({5, 1, 1}, Endpoint::node(0));
  const std::uint32_t foreign = test.fixture.add({60, 1, 1}, Endpoint::node(1));
  test.objects().settle();
  for (const std::uint32_t slot : {owned, foreign}) {
    test.objects().marks(slot) |= host_owned_mark;
  }
  const auto send = [&](std::uint32_t slot, std::uint32_t generation) {
    test.state().nodes[0].broken = false;
    const messages::ReplicaRecord record{slot, generation, {{2, 1, 1}, {}}};
    test.fixture.send(Endpoint::node(0), MessageType::replica, record);
    CHECK(test.ingest.receive());
  };
  send(owned, test.objects().row(owned).object.generation);
  CHECK(test.refused(Status::bad_message) == 0);
  CHECK(test.objects().row(owned).pose.position.x == 2);
  CHECK((test.objects().marks(owned) & reported_mark) != 0);
  CHECK(test.objects().unnotified().empty());
  CHECK(test.states.moved() == 1);
  CHECK(!test.state().nodes[0].received.states);

  send(owned, test.objects().row(owned).object.generation + 1);
  send(reported, test.objects().row(reported).object.generation);
  send(foreign, test.objects().row(foreign).object.generation);
  CHECK(test.refused(Status::bad_message) == 3);
  CHECK(test.objects().row(reported).pose.position.x == 5);
  CHECK(test.objects().row(foreign).pose.position.x == 60);
}

TEST_CASE("the end of a frame is accepted once, after the contacts were sent") {
  Receiver test;
  test.state().stage = FrameStage::closing;
  messages::NodeFrameStats stats;
  stats.hosted = 4;
  test.state().nodes[0].closing.end_run.start(1);
  test.fixture.send(Endpoint::node(0), MessageType::frame_done, stats);
  test.ingest.receive();
  CHECK(!test.state().nodes[0].received.frame_done);
  CHECK(test.refused(Status::bad_message) == 1);
  test.fixture.send(Endpoint::node(1), MessageType::frame_done, stats);
  test.fixture.send(Endpoint::node(1), MessageType::frame_done, stats);
  test.ingest.receive();
  CHECK(test.state().nodes[1].received.frame_done);
  CHECK(test.state().report().nodes[1].hosted == 4);
  CHECK(test.refused(Status::bad_message) == 2);
}

TEST_CASE("what a node of this process reports is accepted once, and counts like the messages that it replaces") {
  Receiver test({.shares_memory = true, .interest = 8});
  test.fixture.publication(0).wanted = true;
  NodeContacts& contacts = test.fixture.node_contacts(0);
  const PeerSession::Received& received = test.state().nodes[0].received;
  CHECK(!test.ingest.receive());
  test.fixture.report(0, ReportedStep::moved);
  CHECK(test.ingest.receive());
  CHECK(received.states);
  CHECK(!received.published);
  CHECK(!test.ingest.receive());

  contacts.report.totals = {.candidates = 5, .tested = 3, .carried = 2, .contacts = 0};
  test.state().stage = FrameStage::colliding;
  test.fixture.report(0, ReportedStep::published);
  test.fixture.report(0, ReportedStep::tested);
  CHECK(test.ingest.receive());
  CHECK(received.published);
  CHECK(received.narrow_done);
  CHECK(test.state().report().accepted == 5);

  const messages::KindRecord kind{.candidates = 3, .timed = 1, .nanoseconds = 70};
  contacts.report.kinds = std::span(&kind, 1);
  contacts.report.stats.hosted = 4;
  contacts.report.stats.host_owned_changes = 3;
  test.fixture.report(0, ReportedStep::done);
  test.ingest.receive();
  CHECK(!received.frame_done);  // the contacts are not final
  test.state().stage = FrameStage::closing;
  for (int times = 0; times < 2; ++times) test.ingest.receive();
  CHECK(received.frame_done);
  CHECK(!test.state().nodes[1].received.states);
  CHECK(test.state().report().nodes[0].hosted == 4);
  CHECK(test.states.moved() == 3);
  REQUIRE(test.state().report().kinds.size() == 1);
  CHECK(test.state().report().kinds[0].candidates == 3);
  CHECK(test.state().report().kinds[0].nanoseconds == 70);
  const TrafficReport& control = test.state().report().traffic[static_cast<std::size_t>(Traffic::control)];
  CHECK(control.messages == 4);  // published, narrow_done, kinds, frame_done
  CHECK(control.bytes ==
        4 * sizeof(messages::Header) + sizeof contacts.report.totals + sizeof kind + sizeof contacts.report.stats);
}

TEST_CASE("tests under an earlier map, reports of an earlier frame and those of a lost node are void") {
  Receiver test({.shares_memory = true});
  test.state().stage = FrameStage::colliding;
  ++test.state().frame;
  test.fixture.report(1, ReportedStep::tested);
  --test.state().frame;
  test.fixture.report(0, ReportedStep::tested);
  regions::RegionMap& map = test.state().map;
  const std::vector<std::uint32_t> table(map.table().begin(), map.table().end());
  map.assign(table, 2, map.epoch() + 1);
  CHECK(!test.ingest.receive());
  CHECK(!test.state().nodes[0].received.narrow_done);
  CHECK(!test.state().nodes[1].received.narrow_done);
  // The bits of the first reports remain, so the second ones are found although no bit is new.
  test.fixture.report(0, ReportedStep::tested);
  test.fixture.report(1, ReportedStep::tested);
  test.state().nodes[1].lost = true;
  CHECK(test.ingest.receive());
  CHECK(test.state().nodes[0].received.narrow_done);
  CHECK(!test.state().nodes[1].received.narrow_done);
}

TEST_CASE("a thread reports once for all its users, and not before it may") {
  Receiver test;
  test.await(0);
  UserConnection& peers = test.state().user_connections[0];
  peers.published = false;
  messages::NodeFrameStats stats;
  stats.published = 3;
  test.fixture.send_for_all(0, stats);                           // too early
  test.fixture.send(Endpoint::user(0), MessageType::published);  // not for all
  test.fixture.send(Endpoint::user(0), MessageType::frame_done, stats);
  test.ingest.receive();
  CHECK(test.refused(Status::bad_message) == 3);
  CHECK(!peers.published);
  test.fixture.send_for_all(0, MessageType::published);
  test.ingest.receive();
  CHECK(peers.published);
  test.state().stage = FrameStage::notifying_users;
  peers.end_run.start(0);
  test.fixture.send_for_all(0, stats);  // its contacts have not been sent
  test.ingest.receive();
  CHECK(!peers.frame_done);
  peers.end_run.stop();
  test.fixture.send_for_all(0, stats);
  test.ingest.receive();
  CHECK(peers.frame_done);
  CHECK(test.refused(Status::bad_message) == 4);
  CHECK(test.state().report().traffic[static_cast<std::size_t>(Traffic::m1)].records == 3);
}

TEST_CASE("messages of a lost node are refused as late") {
  Receiver test;
  test.state().nodes[0].lost = true;
  const std::uint32_t slot = test.fixture.add({1, 1, 1}, Endpoint::node(0));
  test.fixture.send(Endpoint::node(0), MessageType::node_state, test.node_record(slot, {2, 1, 1}, 0));
  CHECK(!test.ingest.receive());
  CHECK(test.ingest.refuse_lost());
  CHECK(!test.ingest.refuse_lost());
  CHECK(test.refused(Status::late) == 1);
  CHECK(test.objects().row(slot).pose.position.x == 1);
}

}  // namespace
}  // namespace ringfence::nodes::test
