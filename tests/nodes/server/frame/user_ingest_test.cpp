#include "nodes/server/frame/user_ingest.hpp"

#include <limits>

#include <doctest/doctest.h>

#include "nodes/server/frame/receiver.hpp"

namespace ringfence::nodes::test {
namespace {

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
  CHECK(test.users.receive());
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
  test.users.receive();
  test.fixture.send(Endpoint::user(0), MessageType::state_update, test.record(own, {6, 1, 1}));
  CHECK(!test.users.receive());
  test.state().awaited_users = 1;  // another user
  CHECK(test.users.receive());
  CHECK(test.refused(Status::bad_message) == 1);
  CHECK(test.objects().row(own).pose.position.x == 5);
}

TEST_CASE("records and bytes of a user above its quotas are refused, but the end of its states counts") {
  Receiver records({.quotas = {.updates = 1}});
  records.await(0);
  const std::uint32_t own = records.fixture.add({1, 1, 1}, Endpoint::user(0), Category::avatar);
  const std::vector<messages::StateRecord> two{records.record(own, {5, 1, 1}), records.record(own, {6, 1, 1})};
  records.fixture.send<messages::StateRecord>(Endpoint::user(0), MessageType::state_update, std::span(two));
  records.users.receive();
  CHECK(records.objects().row(own).pose.position.x == 5);
  CHECK(records.refused(Status::over_quota) == 1);

  Receiver bytes({.quotas = {.bytes = 10}});
  bytes.await(0);
  const std::uint32_t slot = bytes.fixture.add({1, 1, 1}, Endpoint::user(0), Category::avatar);
  bytes.fixture.send(Endpoint::user(0), MessageType::state_update, bytes.record(slot, {5, 1, 1}));
  bytes.users.receive();
  CHECK(bytes.objects().row(slot).pose.position.x == 1);
  CHECK(bytes.refused(Status::over_quota) == 1);
  CHECK(bytes.state().users[0].received.states);
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
  test.users.receive();
  CHECK(test.refused(Status::bad_message) == 3);
  CHECK(!peers.published);
  test.fixture.send_for_all(0, MessageType::published);
  test.users.receive();
  CHECK(peers.published);
  test.state().stage = FrameStage::notifying_users;
  peers.end_run.start(0);
  test.fixture.send_for_all(0, stats);  // its contacts have not been sent
  test.users.receive();
  CHECK(!peers.frame_done);
  peers.end_run.stop();
  test.fixture.send_for_all(0, stats);
  test.users.receive();
  CHECK(peers.frame_done);
  CHECK(test.refused(Status::bad_message) == 4);
  CHECK(test.state().report().traffic[static_cast<std::size_t>(Traffic::m1)].records == 3);
}

}  // namespace
}  // namespace ringfence::nodes::test
