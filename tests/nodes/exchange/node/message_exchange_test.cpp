#include "nodes/exchange/node/message_exchange.hpp"

#include <cstdint>
#include <span>
#include <vector>

#include <doctest/doctest.h>

#include "nodes/cd_node/node_fixture.hpp"

namespace ringfence::nodes::test {
namespace {

using messages::flag_present;

TEST_CASE(
    "without shared memory a node sends its updates to the other node, and their number and states to the server") {
  NodeFixture fixture({.shares_memory = false});
  HaloExchange halo(fixture.state());
  halo.assign();
  NodeExchange& exchange = fixture.exchange();
  exchange.begin();
  const std::uint32_t staying = fixture.host(1, {31.8, 10, 10});
  const std::uint32_t leaving = fixture.host(2, {28, 10, 10});
  fixture.know(2, {31.8, 10, 10});
  halo.begin();
  halo.add_updates(staying, fixture.bounds({31.8, 10, 10}), true, RegionObjects::none);
  halo.add_updates(leaving, fixture.bounds({28, 10, 10}), true, fixture.state().objects.find(2));
  CHECK(exchange.finish_report());
  CHECK(exchange.finish_report());  // once
  CHECK(exchange.send_ghosts());
  const auto counts = fixture.sent_to_server();
  REQUIRE(counts.size() == 2);
  CHECK(counts[1].type() == MessageType::node_state);  // the end of the report
  CHECK(counts[0].type() == MessageType::ghost_counts);
  CHECK(counts[0].record<messages::CountRecord>(0).node == 1);
  CHECK(counts[0].record<messages::CountRecord>(0).count == 2);
  const auto sent = fixture.sent_to_peer();
  REQUIRE(sent.size() == 1);
  CHECK(sent[0].type() == MessageType::ghost);
  REQUIRE(sent[0].header.count == 2);
  CHECK((sent[0].record<messages::PositionRecord>(0).object.flags & messages::flag_left_region) == 0);
  CHECK(sent[0].record<messages::PositionRecord>(1).object.number == 2);
  CHECK((sent[0].record<messages::PositionRecord>(1).object.flags & messages::flag_left_region) != 0);
}

TEST_CASE("updates that arrive as messages are complete when as many as announced have been applied") {
  NodeFixture fixture({.shares_memory = false});
  const NodeState& state = fixture.state();
  HaloExchange halo(fixture.state());
  NodeExchange& exchange = fixture.exchange();
  exchange.begin();
  const auto receive = [&](const messages::MessageView& message) {
    exchange.count_ghosts(message.count());
    halo.apply(message);
  };
  CHECK(!exchange.receive_ghosts(halo));  // not announced
  exchange.expect_ghosts(2);
  const auto keeps = flag_present | messages::flag_keeps_host;
  receive(fixture.message(MessageType::ghost, fixture.position(5, {32.2, 10, 10}, keeps), Endpoint::node(1)));
  CHECK(!exchange.receive_ghosts(halo));
  REQUIRE(state.objects.find(5) != RegionObjects::none);
  CHECK(state.objects.next_host(state.objects.find(5)) == NextHost::node);
  const auto left = messages::flag_left_region;
  receive(fixture.message(MessageType::ghost, fixture.position(5, {36, 10, 10}, left), Endpoint::node(1)));
  CHECK(exchange.receive_ghosts(halo));
  CHECK(state.objects.size() == 0);
  exchange.discard_ghosts();  // the frame is detected again
  CHECK(!exchange.receive_ghosts(halo));
}

messages::SensedRecord sensed_ball(ObjectNumber number, double x) {
  messages::SensedRecord record;
  record.pose = {{x, 10, 10}, {}};
  record.number = number;
  record.generation = 7;
  record.user_data = 100 + number;
  record.layer = 3;
  record.category = static_cast<std::uint16_t>(Category::fixed);
  return record;
}

TEST_CASE("objects that models may sense arrive in parts, belong to the frame before, and serve one frame") {
  NodeFixture fixture({.shares_memory = false});
  NodeState& state = fixture.state();
  NodeExchange& exchange = fixture.exchange();
  exchange.begin();
  CHECK(state.contacts.sensed == nullptr);
  for (const std::uint32_t objects : {3u, 1u}) {
    const std::vector<messages::SensedRecord> first{sensed_ball(5, 10), sensed_ball(2, 20)};
    const std::vector<messages::SensedRecord> last{sensed_ball(9, 30)};
    if (objects == 3) {
      exchange.receive_sensed(
          fixture.message(MessageType::sensed, std::span<const messages::SensedRecord>(first), false));
      CHECK(!exchange.may_begin());
    }
    exchange.receive_sensed(fixture.message(MessageType::sensed, std::span<const messages::SensedRecord>(last)));
    CHECK(exchange.may_begin());
    exchange.begin();
    const queries::RecordedFrame* const frame = state.contacts.sensed;
    REQUIRE(frame != nullptr);
    CHECK(frame->number() == state.frame - 1);
    REQUIRE(frame->rows().size() == objects);
    CHECK(frame->size() == objects);
    const queries::FrameObject& object = frame->rows()[objects - 1];
    CHECK(object.number == 9);
    CHECK(object.generation == 7);
    CHECK(object.pose.position.x == 30);
    CHECK(object.layer == 3);
    CHECK(object.category == static_cast<std::uint8_t>(Category::fixed));
    CHECK(object.user_data == 109);
  }
  ++state.frame;
  exchange.begin();
  CHECK(state.contacts.sensed == nullptr);
}

Contact contact_of(ObjectNumber a, ObjectNumber b) {
  Contact contact;
  contact.a = a;
  contact.b = b;
  return contact;
}

TEST_CASE("contacts of the server are of the frame before; those of other nodes are of this frame, and are sorted") {
  NodeFixture fixture({.shares_memory = false});
  NodeState& state = fixture.state();
  state.contacts.start(1);
  state.contacts.for_peers.finish(2);
  NodeExchange& exchange = fixture.exchange();
  exchange.begin_contacts();
  state.host.contacts().add_late(fixture.message(MessageType::notify, contact_of(7, 9)));
  CHECK(state.host.contacts().received(1).empty());
  exchange.expect_contacts(3);
  const Contact some[] = {contact_of(8, 9), contact_of(3, 4)};
  exchange.receive_contacts(
      fixture.message(MessageType::notify, std::span<const Contact>(some), true, Endpoint::node(1)));
  CHECK(!exchange.complete_contacts());
  exchange.receive_contacts(fixture.message(MessageType::notify, contact_of(3, 5), Endpoint::node(1)));
  CHECK(exchange.complete_contacts());
  const auto received = state.host.contacts().received(1);
  REQUIRE(received.size() == 3);
  CHECK(received[0].b == 4);
  CHECK(received[1].b == 5);
  CHECK(received[2].a == 8);
}

TEST_CASE("contacts of a lost node are not awaited, but those that it has sent count") {
  NodeFixture fixture({.shares_memory = false});
  NodeState& state = fixture.state();
  state.contacts.start(1);
  state.contacts.for_peers.finish(2);
  NodeExchange& exchange = fixture.exchange();
  exchange.begin_contacts();
  exchange.expect_contacts(3);
  exchange.receive_contacts(fixture.message(MessageType::notify, contact_of(3, 5), Endpoint::node(1)));
  CHECK(!exchange.complete_contacts());
  exchange.lose({1, 0, 0, 3});
  CHECK(exchange.complete_contacts());
  CHECK(state.host.contacts().received(1).size() == 1);
}

}  // namespace
}  // namespace ringfence::nodes::test
