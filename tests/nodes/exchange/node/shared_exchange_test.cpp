#include "nodes/exchange/node/shared_exchange.hpp"

#include <array>

#include <doctest/doctest.h>

#include "nodes/cd_node/node_fixture.hpp"
#include "nodes/exchange/counted_bell.hpp"

namespace ringfence::nodes::test {
namespace {

using messages::flag_present;

TEST_CASE("a node whose ring to the server is full wakes it, and notes that there are messages") {
  NodeFixture fixture({.ring_bytes = 4096});
  CountedBell server;
  fixture.frame_control().set_server_bell(&server.bell());
  fixture.frame_control().expect({1, 0}, false);
  fixture.exchange().begin();
  for (ObjectNumber number = 1; number <= 100; ++number) {
    fixture.host(number, {10, 10, 10});
    fixture.exchange().add_change(number - 1, flag_present, fixture.bounds({10, 10, 10}));
  }
  CHECK(!fixture.exchange().report_batch());
  CHECK(server.was_rung());
  std::size_t senders = 0;
  fixture.frame_control().take_senders([&](NodeNumber) { ++senders; });
  CHECK(senders == 1);
  std::size_t records = 0;
  while (!fixture.exchange().report_batch()) {
    for (const LoggedMessage& message : fixture.sent_to_server()) records += message.header.count;
  }
  CHECK(fixture.exchange().finish_report());
  for (const LoggedMessage& message : fixture.sent_to_server()) {
    records += message.header.count;
    CHECK(message.header.last == 0);  // the word says that no more follow
  }
  CHECK(records == 100);
  CHECK(fixture.state().contacts.report.reached.load() == FrameMark(1, 1, ReportedStep::moved));
}

TEST_CASE("a node that is dismissed follows no later announcement") {
  NodeFixture fixture;
  fixture.frame_control().announce(7, 1, AnnouncedStep::frame_begin);
  CHECK(fixture.exchange().announced().is_of(7));
  CHECK(fixture.exchange().announced_frame() == 7);
  fixture.state().contacts.report.dismissed = true;
  fixture.frame_control().announce(8, 1, AnnouncedStep::frame_begin);
  CHECK(fixture.exchange().announced() == FrameControl::Announced());
}

TEST_CASE("the updates of a peer are applied only while the gate admits the node") {
  NodeFixture fixture;
  const NodeState& state = fixture.state();
  HaloExchange halo(fixture.state());
  GhostUpdates& updates = fixture.peer().ghost_updates;
  updates.start(1);
  updates.add(fixture.position(5, {32.2, 10, 10}, flag_present | messages::flag_keeps_host));
  updates.add_receiver(0, false);
  updates.finish(2);
  fixture.state().contacts.ghost_senders.add(1);
  fixture.exchange().receive_ghosts(halo);
  CHECK(state.objects.size() == 0);
  fixture.state().contacts.ghost_updates.gate.admit();
  fixture.exchange().receive_ghosts(halo);
  const std::uint32_t known = state.objects.find(5);
  REQUIRE(known != RegionObjects::none);
  CHECK(state.objects.next_host(known) == NextHost::node);
  CHECK(!state.objects.inner(known));
  CHECK(!fixture.state().contacts.ghost_updates.gate.is_inside());

  updates.start(1);
  updates.add(fixture.position(5, {36, 10, 10}));
  updates.add_receiver(0, true);
  updates.finish(2);
  fixture.state().contacts.ghost_senders.add(1);
  fixture.state().contacts.ghost_updates.gate.admit();
  fixture.exchange().receive_ghosts(halo);
  CHECK(state.objects.size() == 0);
}

TEST_CASE(
    "an update that is handed over to this node makes it the next host, and updates of other frames are ignored") {
  NodeFixture fixture;
  const NodeState& state = fixture.state();
  HaloExchange halo(fixture.state());
  GhostUpdates& updates = fixture.peer().ghost_updates;
  for (const std::uint64_t frame : {0u, 1u}) {
    updates.start(frame);
    updates.add(fixture.position(5, {31.8, 10, 10}));
    updates.add_receiver(0, false);
    updates.finish(2);
    fixture.state().contacts.ghost_senders.add(1);
    fixture.state().contacts.ghost_updates.gate.admit();
    fixture.exchange().receive_ghosts(halo);
    CHECK(state.objects.size() == frame);
  }
  CHECK(state.objects.next_host(state.objects.find(5)) == NextHost::self);
}

TEST_CASE("the updates that a node gives to others are counted anew in each frame") {
  NodeFixture fixture;
  fixture.state().contacts.report.taken = fixture.state().contacts.report.duplicates = 7;  // of the frame before
  fixture.exchange().begin();
  GhostUpdates& updates = fixture.state().contacts.ghost_updates;
  updates.start(1);
  updates.add(fixture.position(5, {31.8, 10, 10}));
  updates.add_receiver(1, false);
  fixture.exchange().finish_report();
  CHECK(fixture.state().contacts.report.ghosts == 1);
  CHECK(fixture.state().contacts.report.taken == 0);
  CHECK(fixture.state().contacts.report.duplicates == 0);
  fixture.exchange().begin();
  CHECK(fixture.state().contacts.report.ghosts == 0);
}

TEST_CASE("the node reads the contacts of its objects from its peer if the gate admits it") {
  for (const bool admitted : {false, true}) {
    NodeFixture fixture;
    NodeState& state = fixture.state();
    state.contacts.start(1);
    state.contacts.for_peers.finish(2);
    NodeContacts& peer = fixture.peer();
    std::array<narrow_phase::Body, 2> bodies;
    bodies[0].number = 7;
    bodies[1].number = 9;
    const narrow_phase::PairContact touch{0, 0.25f, {}, {}};
    peer.start(1);
    peer.touches = &touch;
    peer.bodies = bodies.data();
    peer.keys.push_back(base::PairSort::key(7, 9));
    peer.found.push_back({0, 0, 0, 1, 0});
    peer.compare([](const FoundContact&) { return true; }, [](std::uint64_t, const FoundContact&) { return true; });
    peer.for_peers.add(0, 0);
    peer.for_peers.finish(2);
    state.contacts.contact_senders.add(1);
    NodeContacts* const all[] = {&state.contacts, &peer};
    OutputMerge merge;
    std::array<Contact, 1> contacts;
    std::array<std::uint64_t, 1> keys;
    std::array<Found, 1> finders;
    merge.node_contacts = all;
    merge.contacts = contacts.data();
    merge.keys = keys.data();
    merge.found = finders.data();
    state.contacts.output_merge = &merge;
    if (admitted) state.contacts.gate.admit();
    fixture.exchange().share_contacts();
    const auto received = state.host.contacts().received(1);
    REQUIRE(received.size() == (admitted ? 1 : 0));
    if (admitted) {
      CHECK(received[0].a == 7);
      CHECK(received[0].b == 9);
      CHECK(received[0].phase == Phase::begin);
      CHECK(contacts[0].depth == 0.25f);  // the slice of the output lists
      CHECK(finders[0].by == 1);
      CHECK(state.contacts.report.taken == 1);
    }
  }
}

}  // namespace
}  // namespace ringfence::nodes::test
