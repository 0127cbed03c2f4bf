#include "nodes/server/frame/dispatch.hpp"

#include <algorithm>
#include <map>
#include <set>

#include <doctest/doctest.h>

#include "nodes/server/server_fixture.hpp"

namespace ringfence::nodes::test {
namespace {

struct Dispatching {
  explicit Dispatching(const FixtureConfig& config = {}) : fixture(config) {}
  ServerState& state() { return fixture.state(); }
  ObjectTable& objects() { return fixture.state().objects; }
  /// Sends the updates and pairs of a frame.
  void send(UpdateScope scope = UpdateScope::changes) {
    dispatch.start(scope, fixture.exchange());
    REQUIRE(state().all_nodes([&](const PeerSession& node) { return dispatch.send_updates(node); }));
    REQUIRE(dispatch.send_pairs());
  }
  /// What a node has received: by object number, whether the object left its region; and its pairs, by slots.
  struct Received {
    std::map<ObjectNumber, bool> updates;
    std::set<std::pair<std::uint32_t, std::uint32_t>> pairs;
  };
  Received received(NodeNumber node) {
    Received received;
    for (const SentMessage& message : fixture.sent_to(Endpoint::node(node))) {
      for (std::size_t i = 0; i < message.header.count; ++i) {
        if (message.type() == MessageType::position_update) {
          const messages::ObjectRef object = message.record<messages::PositionRecord>(i).object;
          received.updates[object.number] = (object.flags & messages::flag_left_region) != 0;
        } else {
          const auto pair = message.record<messages::PairRecord>(i);
          received.pairs.insert({pair.a, pair.b});
        }
      }
    }
    return received;
  }
  void move(std::uint32_t slot, const Vec3d& position) {
    ObjectRow& row = objects().change_row(slot);
    row.pose.position = position;
    objects().bounds(slot) = state().setup.shapes->bounds(0, row.pose, *state().setup.space);
    objects().mark_moved(slot);
  }

  ServerFixture fixture;
  Dispatch dispatch{fixture.state()};
};

using Updates = std::map<ObjectNumber, bool>;

TEST_CASE("an object goes to the nodes whose regions its bounds touch, and its departure to those that they touched") {
  Dispatching test;
  const std::uint32_t slot = test.fixture.add({31.8, 1, 1}, Endpoint::server());
  const ObjectNumber number = test.objects().row(slot).object.number;
  test.send();
  CHECK(test.received(0).updates == Updates{{number, false}});
  CHECK(test.received(1).updates == Updates{{number, false}});
  test.objects().settle();
  test.send();
  CHECK(test.received(0).updates.empty());
  test.move(slot, {40, 1, 1});
  test.send();
  CHECK(test.received(0).updates == Updates{{number, true}});
  CHECK(test.received(1).updates == Updates{{number, false}});
}

TEST_CASE("the host of an object receives no update of a state that it reported") {
  Dispatching test;
  const std::uint32_t slot = test.fixture.add({31.8, 1, 1}, Endpoint::node(0));
  test.objects().marks(slot) |= reported_mark;
  test.send();
  CHECK(test.received(0).updates.empty());
  CHECK(test.received(1).updates.size() == 1);
  test.send(UpdateScope::all_objects);
  CHECK(test.received(0).updates.size() == 1);  // it has cleared its entries
}

TEST_CASE("each candidate goes to the node that owns its lower corner, and to no other") {
  Dispatching test;
  const std::uint32_t left = test.fixture.add({30.9, 1, 1}, Endpoint::server());
  const std::uint32_t middle = test.fixture.add({31.7, 1, 1}, Endpoint::server());
  const std::uint32_t right = test.fixture.add({32.6, 1, 1}, Endpoint::server());
  test.send();
  using Pairs = std::set<std::pair<std::uint32_t, std::uint32_t>>;
  CHECK(test.received(0).pairs == Pairs{{left, middle}});
  CHECK(test.received(1).pairs == Pairs{{middle, right}});
  CHECK(test.dispatch.candidates() == 2);
}

TEST_CASE("a lost node and a free slot receive nothing") {
  Dispatching test({.nodes = 3});
  test.fixture.add({63, 1, 1}, Endpoint::server());
  test.state().nodes[0].lost = true;
  test.state().nodes[1].connected = false;
  test.send();
  CHECK(test.fixture.sent_to(Endpoint::node(0)).empty());
  CHECK(test.fixture.sent_to(Endpoint::node(1)).empty());
  CHECK(!test.fixture.sent_to(Endpoint::node(2)).empty());
}

}  // namespace
}  // namespace ringfence::nodes::test
