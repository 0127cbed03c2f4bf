#include "nodes/server/objects/object_states.hpp"

#include <doctest/doctest.h>

#include "nodes/server/server_fixture.hpp"

namespace ringfence::nodes::test {
namespace {

constexpr FixtureConfig sharing{.placement = Placement::region, .shares_memory = true};

/// A fixture with one host-owned object of node 0 that its host has moved since the table received it.
struct HostOwned {
  HostOwned() : slot(fixture.add(before.position, Endpoint::node(0))) {
    objects().settle();  // the frame in which it appeared is over
    objects().marks(slot) |= host_owned_mark;
    Host& host = fixture.host(0);
    host.place(number(), now, true);
    host.set_host_owned(host.find(number()), true);
  }
  ObjectTable& objects() { return fixture.state().objects; }
  ObjectNumber number() { return objects().row(slot).object.number; }
  geometry::Bounds bounds_at(const Pose& pose) {
    return fixture.state().setup.shapes->bounds(0, pose, *fixture.state().setup.space);
  }

  Pose before{{10, 10, 10}, {}}, now{{11, 12, 13}, {}};
  ServerFixture fixture{sharing};
  ObjectStates states{fixture.state(), fixture.exchange()};
  std::uint32_t slot;
};

TEST_CASE("the pose of a host-owned object is that of its host, any other that of the table") {
  HostOwned test;
  CHECK(test.states.pose(test.slot) == test.now);
  CHECK(test.objects().row(test.slot).pose == test.before);
  test.objects().marks(test.slot) = alive_mark;
  CHECK(test.states.pose(test.slot) == test.before);
}

TEST_CASE("storing all states brings poses and bounds to this frame and counts no object twice") {
  HostOwned test;
  test.states.begin();
  test.states.store_all();
  CHECK(test.objects().row(test.slot).pose == test.now);
  CHECK(test.objects().bounds()[test.slot] == test.bounds_at(test.now));
  CHECK(test.objects().moved().size() == 1);
  CHECK(test.states.moved() == 0);  // the node reports how many objects it moved
  test.states.add_moved(1);
  test.fixture.host(0).place(test.number(), test.before, true);
  test.fixture.host(0).set_host_owned(0, true);
  test.states.store_all();  // stored in this frame already
  CHECK(test.objects().row(test.slot).pose == test.now);
  CHECK(test.states.moved() == 1);
}

TEST_CASE("a state is stored only from the object's host, and only if the host owns it") {
  HostOwned test;
  const messages::ObjectRef object = test.objects().row(test.slot).object;
  ServerState& state = test.fixture.state();
  test.states.store(state.nodes[1], 1, object, test.now, nullptr);
  CHECK(test.objects().row(test.slot).pose == test.before);
  messages::ObjectRef stale = object;
  ++stale.generation;
  test.states.store(state.nodes[0], 1, stale, test.now, nullptr);
  CHECK(test.objects().row(test.slot).pose == test.before);
  test.objects().marks(test.slot) |= reported_mark;
  test.states.store(state.nodes[0], 1, object, test.now, nullptr);
  CHECK(test.objects().row(test.slot).pose == test.before);
}

TEST_CASE("an object that is no longer host-owned is sent by the server from the state of its host") {
  HostOwned test;
  test.states.end_host_owned(test.slot);
  CHECK(test.objects().row(test.slot).pose == test.now);
  CHECK(test.objects().bounds()[test.slot] == test.bounds_at(test.now));
  CHECK(test.objects().marks(test.slot) == (alive_mark | notified_mark | shared_mark));
  CHECK(test.states.pose(test.slot) == test.now);
}

TEST_CASE("the table keeps no states of objects that nodes host, unless a node may be lost") {
  for (const bool may_be_lost : {true, false}) {
    CAPTURE(may_be_lost);
    ServerFixture fixture({.placement = Placement::region, .shares_memory = true, .nodes_may_be_lost = may_be_lost});
    ObjectStates states(fixture.state(), fixture.exchange());
    ObjectTable& objects = fixture.state().objects;
    const std::uint32_t hosted = fixture.add({10, 10, 10}, Endpoint::node(0));
    const std::uint32_t own = fixture.add({10, 10, 10}, Endpoint::server());
    objects.settle();
    states.release();
    CHECK(((objects.marks(hosted) & no_state_mark) == 0) == may_be_lost);
    CHECK((objects.marks(own) & no_state_mark) == 0);
    CHECK(states.state(hosted) == (may_be_lost ? objects.state(hosted) : fixture.host(0).state(0)));
    CHECK(states.state(own) == objects.state(own));
    states.fetch_state(hosted);
    CHECK(states.state(hosted) == objects.state(hosted));
  }
}

TEST_CASE("the states that a lost node kept are stored and count as moved") {
  HostOwned test;
  ServerState& state = test.fixture.state();
  HostOwnedStates& kept = test.fixture.node_contacts(0).host_states;
  kept.begin(1);
  kept.add(1, test.objects().row(test.slot).object, test.now, nullptr);
  kept.finish();
  state.nodes[0].lost = true;
  test.states.store_all();  // does not read a lost node
  CHECK(test.objects().row(test.slot).pose == test.before);
  test.states.store_kept(state.nodes[0], 1);
  CHECK(test.objects().row(test.slot).pose == test.now);
  CHECK(test.states.moved() == 1);
}

TEST_CASE("the moves of a host of the server are stored with their bounds") {
  ServerFixture fixture;
  ObjectStates states(fixture.state(), fixture.exchange());
  ObjectTable& objects = fixture.state().objects;
  const std::uint32_t slot = fixture.add({10, 10, 10}, Endpoint::server());
  objects.settle();
  Host host(nullptr, 4);
  host.adopt(objects.hand_over(slot), objects.state(slot));
  const Pose steered{{20, 10, 10}, {}};
  host.steer(objects.row(slot).object.number, steered);
  host.move(1);
  states.apply_moves(host);
  CHECK(objects.row(slot).pose == steered);
  CHECK(objects.bounds()[slot] == fixture.state().setup.shapes->bounds(0, steered, *fixture.state().setup.space));
  CHECK(states.moved() == 1);
}

}  // namespace
}  // namespace ringfence::nodes::test
