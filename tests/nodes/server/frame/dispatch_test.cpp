#include "nodes/server/frame/dispatch.hpp"

#include <algorithm>
#include <map>
#include <random>
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
    std::map<ObjectNumber, Vec3d> positions;
    std::size_t records = 0;  ///< updates, counted with those that are sent twice
    std::set<std::pair<std::uint32_t, std::uint32_t>> pairs;
  };
  Received received(NodeNumber node) {
    Received received;
    for (const SentMessage& message : fixture.sent_to(Endpoint::node(node))) {
      for (std::size_t i = 0; i < message.header.count; ++i) {
        if (message.type() == MessageType::position_update) {
          const auto record = message.record<messages::PositionRecord>(i);
          const messages::ObjectRef object = record.object;
          received.positions[object.number] = record.pose.position;
          ++received.records;
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

TEST_CASE("what is prepared while nodes still move changes nothing of what they receive") {
  std::mt19937 random(4);
  const auto coordinate = [&] { return std::uniform_real_distribution<double>(0, 63)(random); };
  const FixtureConfig config{.nodes = 5, .placement = Placement::region};
  Dispatching prepared(config), at_once(config);
  constexpr std::uint32_t objects = 60;
  for (std::uint32_t slot = 0; slot < objects; ++slot) {
    const Endpoint host = slot % 3 == 0 ? Endpoint::server() : Endpoint::node(slot % 5);
    const Vec3d position{coordinate(), coordinate(), coordinate()};
    REQUIRE(prepared.fixture.add(position, host) == at_once.fixture.add(position, host));
  }
  std::size_t updates = 0, removals = 0;
  for (int frame = 0; frame < 40; ++frame) {
    CAPTURE(frame);
    const UpdateScope scope = frame % 10 == 7   ? UpdateScope::all_objects
                              : frame % 10 == 9 ? UpdateScope::not_hosted
                                                : UpdateScope::changes;
    // Objects of nodes are changed before and after the preparation: by requests, and when the nodes report.
    for (int step = 0; step < 2; ++step) {
      for (std::uint32_t slot = 0; slot < objects; ++slot) {
        const bool by_node = slot % 3 != 0;
        if (random() % 3 != 0 || (!by_node && step == 1)) continue;
        const Vec3d position{coordinate(), coordinate(), coordinate()};
        for (Dispatching* test : {&prepared, &at_once}) {
          test->move(slot, position);
          if (by_node && step == 1) test->objects().marks(slot) |= reported_mark;
        }
      }
      if (step == 0 && frame % 4 != 3) prepared.dispatch.prepare();
    }
    prepared.send(scope);
    at_once.send(scope);
    for (NodeNumber node = 0; node < config.nodes; ++node) {
      CAPTURE(node);
      const auto one = prepared.received(node), other = at_once.received(node);
      CHECK(one.updates == other.updates);
      CHECK(one.positions == other.positions);
      CHECK(one.records == other.records);
      updates += one.records;
      for (const auto& [number, gone] : one.updates) removals += gone ? 1 : 0;
    }
    prepared.objects().settle();
    at_once.objects().settle();
  }
  CHECK(updates > 1000);
  CHECK(removals > 100);
}

}  // namespace
}  // namespace ringfence::nodes::test
