#include "nodes/server/recovery/failover.hpp"

#include <algorithm>

#include <doctest/doctest.h>

#include "nodes/server/server_fixture.hpp"

namespace ringfence::nodes::test {
namespace {

/// Moves each object by 1 m along x in a frame.
class WalkingModel : public MotionModel {
 public:
  void move(std::uint64_t, std::span<const MotionInput>, std::span<MotionOutput> outputs) const override {
    for (MotionOutput& output : outputs) output.pose.position.x += 1;
  }
};

struct Losses {
  explicit Losses(const FixtureConfig& config = {.nodes = 3}) : fixture(config) {}
  ServerState& state() { return fixture.state(); }
  ObjectTable& objects() { return fixture.state().objects; }
  bool owns(NodeNumber node) { return std::count(state().map.table().begin(), state().map.table().end(), node) != 0; }

  ServerFixture fixture;
  ObjectStates states{fixture.state(), fixture.exchange()};
  StateRelay relay{fixture.state(), fixture.exchange()};
  Statistics statistics{fixture.state()};
  Failover failover{fixture.state(), fixture.exchange(), states, relay, statistics};
};

TEST_CASE("before the contacts are known, the others get the cells of a lost node and detect the frame again") {
  Losses test;
  test.state().stage = FrameStage::colliding;
  for (PeerSession& node : test.state().nodes) node.received.narrow_done = true;
  const std::uint32_t epoch = test.state().map.epoch();
  test.failover.lose(1);
  CHECK(test.state().stage == FrameStage::moving);
  CHECK(test.state().map.epoch() == epoch + 1);
  CHECK(!test.owns(1));
  CHECK(!test.state().nodes[0].received.narrow_done);
  CHECK(test.state().map_change.updates == UpdateScope::all_objects);
  CHECK(test.state().report().lost == std::vector<NodeId>{NodeId(1)});
  REQUIRE(test.failover.is_pending());
  REQUIRE(test.failover.send());
  CHECK(!test.failover.is_pending());
  for (const NodeNumber node : {0u, 2u}) {
    const auto sent = test.fixture.sent_to(Endpoint::node(node));
    REQUIRE(sent.size() == 2);
    CHECK(sent[0].type() == MessageType::lost);
    CHECK(sent[0].record<messages::LostRecord>(0).node == 1);
    CHECK(sent[0].record<messages::LostRecord>(0).detect_again == 1);
    CHECK(sent[1].type() == MessageType::region_map);
    CHECK(sent[1].header.epoch == epoch + 1);
  }
  CHECK(test.fixture.sent_to(Endpoint::node(1)).empty());
  test.failover.lose(1);  // known
  CHECK(test.state().map.epoch() == epoch + 1);
}

TEST_CASE("the server moves the objects that a lost node has not reported, and keeps the reported states") {
  const WalkingModel model;
  Losses test({.nodes = 3, .model = &model});
  const std::uint32_t reported = test.fixture.add({10, 1, 1}, Endpoint::node(1));
  const std::uint32_t silent = test.fixture.add({20, 1, 1}, Endpoint::node(1));
  const std::uint32_t other = test.fixture.add({30, 1, 1}, Endpoint::node(0));
  test.objects().marks(reported) |= reported_mark;
  test.state().stage = FrameStage::moving;
  test.failover.lose(1);
  CHECK(test.objects().row(reported).pose.position.x == 10);
  CHECK(test.objects().row(silent).pose.position.x == 21);
  CHECK(test.objects().row(other).pose.position.x == 30);
  CHECK(test.objects().host(reported).is_server());
  CHECK(test.objects().host(silent).is_server());
  CHECK(test.objects().host(other) == Endpoint::node(0));
  CHECK(test.failover.holds_objects());
}

TEST_CASE("host-owned objects of a lost node are moved from the states that it kept of the frame before") {
  const WalkingModel model;
  Losses test({.nodes = 2, .placement = Placement::region, .model = &model, .shares_memory = true});
  const std::uint32_t slot = test.fixture.add({10, 1, 1}, Endpoint::node(1));
  test.objects().marks(slot) |= host_owned_mark;
  HostOwnedStates& kept = test.fixture.node_contacts(1).host_states;
  kept.begin(0);
  kept.add(0, test.objects().row(slot).object, {{15, 1, 1}, {}}, nullptr);
  kept.finish();
  test.state().stage = FrameStage::moving;
  test.failover.lose(1);
  CHECK(test.objects().row(slot).pose.position.x == 16);
  CHECK((test.objects().marks(slot) & host_owned_mark) == 0);
}

TEST_CASE("after the contacts are known, hand-overs of a lost node are void and the frame goes on") {
  Losses test;
  test.state().stage = FrameStage::notifying;
  const std::uint32_t early = test.fixture.add({1, 1, 1}, Endpoint::node(0));
  const std::uint32_t late = test.fixture.add({2, 1, 1}, Endpoint::node(2));
  const std::uint32_t stays = test.fixture.add({3, 1, 1}, Endpoint::node(2));
  test.state().hand_overs = {{early, 1, 0}, {late, 1, 2}, {stays, 0, 2}};
  test.state().nodes[0].hand_overs = 1;
  test.state().nodes[0].end_run.start(1);  // not sent yet
  test.state().nodes[2].hand_overs = 2;    // frame_end was sent
  const std::uint32_t epoch = test.state().map.epoch();
  test.failover.lose(1);
  CHECK(test.state().stage == FrameStage::notifying);
  CHECK(test.state().map.epoch() == epoch);
  CHECK(test.state().nodes[0].hand_overs == 0);
  CHECK(test.state().nodes[0].opening.drops == std::vector<std::uint32_t>{early});
  CHECK(test.state().nodes[2].opening.drops == std::vector<std::uint32_t>{late});
  CHECK(test.objects().host(early).is_server());
  CHECK(test.objects().host(late).is_server());
  CHECK(test.objects().host(stays) == Endpoint::node(2));
  REQUIRE(test.failover.send());
  const auto to_first = test.fixture.sent_to(Endpoint::node(0)), to_third = test.fixture.sent_to(Endpoint::node(2));
  REQUIRE(to_first.size() == 1);
  REQUIRE(to_third.size() == 1);
  CHECK(to_first[0].record<messages::LostRecord>(0).detect_again == 0);
  CHECK(to_first[0].record<messages::LostRecord>(0).hand_overs == 0);
  CHECK(to_third[0].record<messages::LostRecord>(0).hand_overs == 1);
}

TEST_CASE("at the next cut a recovered object goes to the node whose region contains it") {
  Losses test;
  const std::uint32_t slot = test.fixture.add({63, 1, 1}, Endpoint::node(1));
  test.state().stage = FrameStage::moving;
  test.failover.lose(1);
  test.state().nodes[1] = {};  // its slot is free
  test.failover.replace_lost_nodes();
  CHECK(test.state().map_change.precedes_frame);
  test.failover.rehost_recovered();
  const NodeNumber owner = test.state().owner_at({63, 1, 1});
  REQUIRE(owner != 1);
  CHECK(test.objects().host(slot) == Endpoint::node(owner));
  CHECK(test.state().nodes[owner].opening.adoptions == base::SystemVector<std::uint32_t>{slot});
  CHECK(test.state().host_changes == std::vector<std::uint32_t>{slot});
  CHECK(!test.failover.holds_objects());
}

TEST_CASE("after the last node is lost, the frame waits for a fallback node, which owns all cells") {
  Losses test({.nodes = 2});
  test.state().stage = FrameStage::dispatching;
  test.failover.lose(0);
  CHECK(!test.fixture.order().fallback_wanted);
  test.failover.lose(1);
  REQUIRE(test.fixture.order().fallback_wanted);
  CHECK(test.fixture.order().fallback_slot == 1);
  CHECK(!test.owns(0));
  CHECK(!test.failover.send());
  test.fixture.order().fallback = test.fixture.connection(Endpoint::node(1));
  test.fixture.order().fallback_id = 9;
  test.fixture.order().fallback_ready = true;
  REQUIRE(test.failover.send());
  CHECK(test.state().nodes[1].is_active());
  CHECK(test.state().report().nodes[1].id == NodeId(9));
  const auto sent = test.fixture.sent_to(Endpoint::node(1));
  REQUIRE(sent.size() == 1);  // the facade has given it the map
  CHECK(sent[0].type() == MessageType::frame_begin);
}

TEST_CASE("nodes that broke the protocol are lost, each once") {
  Losses test;
  test.state().stage = FrameStage::moving;
  test.state().nodes[0].broken = test.state().nodes[2].broken = true;
  test.failover.lose_broken_nodes();
  test.failover.lose_broken_nodes();
  CHECK(test.state().report().lost == std::vector<NodeId>{NodeId(0), NodeId(2)});
  CHECK(test.state().nodes[1].is_active());
}

}  // namespace
}  // namespace ringfence::nodes::test
