#include "nodes/server/frame/reported_states.hpp"

#include <doctest/doctest.h>

#include "nodes/server/frame/receiver.hpp"

namespace ringfence::nodes::test {
namespace {

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
  CHECK(test.nodes.receive());
  CHECK(test.objects().row(inner).pose.position.x == 2);
  CHECK((test.objects().marks(inner) & inner_mark) != 0);
  CHECK(test.objects().row(leaver).pose.position.x == 33);
  CHECK(test.state().leaving == std::vector<NextHostOf>{{leaver, 1}});
  CHECK(test.objects().row(foreign).pose.position.x == 60);
  CHECK(test.refused(Status::not_host) == 1);
  CHECK(test.objects().unnotified().size() == 1);  // only the node needs to know the inner one
  CHECK(test.states.moved() == 2);
  CHECK(test.state().nodes[0].received.states);
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
    CHECK(test.nodes.receive());
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

}  // namespace
}  // namespace ringfence::nodes::test
