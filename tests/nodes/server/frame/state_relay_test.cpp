#include "nodes/server/frame/state_relay.hpp"

#include <algorithm>

#include <doctest/doctest.h>

#include "nodes/server/server_fixture.hpp"

namespace ringfence::nodes::test {
namespace {

constexpr FixtureConfig publishing{.placement = Placement::region, .shares_memory = true, .interest = 8};

std::vector<ObjectNumber> published(const Published& published, std::uint64_t frame) {
  std::vector<ObjectNumber> numbers;
  for (const PublishedState& state : published.publication->states(frame)) {
    numbers.push_back(state.number);
  }
  std::sort(numbers.begin(), numbers.end());
  return numbers;
}

/// The node publishes one object, as it does before it sends `published`.
void publish(ServerFixture& fixture, NodeNumber node, ObjectNumber number) {
  const std::uint64_t frame = fixture.state().frame;
  const Pose pose = fixture.state().objects.row(fixture.state().objects.find(number)).pose;
  Publication& publication = fixture.publication(node).publication;
  publication.begin(frame);
  publication.list_first(1);
  publication.publish([](std::uint32_t) {},
                      [&](std::uint32_t, PublishedState& to) {
                        to = {number, 0, pose};
                        return Publication::Written::state;
                      });
  note_published(fixture.publication(node).published, frame);
  fixture.state().nodes[node].received.published = true;
}

bool is_ready(StateRelay& relay, ServerFixture& fixture) {
  return relay.is_ready(
      [&] { return fixture.state().all_nodes([](const PeerSession& node) { return node.received.published; }); });
}

TEST_CASE("the server publishes the active and non-active objects of nodes in other processes") {
  ServerFixture fixture({.interest = 8});
  fixture.connect(0);
  fixture.add({1, 1, 1}, Endpoint::node(0));
  fixture.add({2, 1, 1}, Endpoint::node(0), Category::non_active);
  fixture.add({3, 1, 1}, Endpoint::user(0), Category::avatar);
  fixture.add({4, 1, 1}, Endpoint::none(), Category::fixed);
  StateRelay relay(fixture.state(), fixture.exchange());
  relay.begin();
  relay.publish(false);
  CHECK(published(fixture.publications().server, 1) == std::vector<ObjectNumber>{1, 2});
  REQUIRE(is_ready(relay, fixture));
  relay.allow_reading();
  CHECK(fixture.publications().relays[1] == std::vector<const Published*>{&fixture.publications().server});
  const auto sent = fixture.sent_to(Endpoint::user(0));
  REQUIRE(sent.size() == 1);
  CHECK(sent[0].type() == MessageType::read_publications);
  CHECK(!is_ready(relay, fixture));  // once a frame
}

TEST_CASE(
    "users also wait for the publications of all user threads, and a thread whose users are lost publishes none") {
  ServerFixture fixture({.interest = 8});
  for (const UserNumber user : {0u, 1u}) {
    fixture.connect(user);
    fixture.state().user_connections[user].published = false;
  }
  StateRelay relay(fixture.state(), fixture.exchange());
  relay.begin();
  relay.publish(false);
  fixture.state().user_connections[0].published = true;
  CHECK(!is_ready(relay, fixture));
  fixture.state().lose_user(fixture.state().users[1]);
  CHECK(is_ready(relay, fixture));
}

TEST_CASE("users read when all nodes that publish have published, and the server publishes nothing then") {
  ServerFixture fixture(publishing);
  fixture.connect(0);
  fixture.add({1, 1, 1}, Endpoint::node(0));
  fixture.add({60, 1, 1}, Endpoint::node(1));
  StateRelay relay(fixture.state(), fixture.exchange());
  relay.begin();
  CHECK(fixture.publication(0).wanted);
  relay.publish(false);
  publish(fixture, 0, 1);
  CHECK(!is_ready(relay, fixture));
  publish(fixture, 1, 2);
  REQUIRE(is_ready(relay, fixture));
  relay.allow_reading();
  CHECK(fixture.publications().relays[1] ==
        std::vector<const Published*>{&fixture.publication(0).published, &fixture.publication(1).published});
  CHECK(fixture.state().report().traffic[static_cast<std::size_t>(Traffic::state)].records == 2);
}

TEST_CASE("the server publishes the objects of a node that is lost before users read") {
  ServerFixture fixture(publishing);
  fixture.connect(0);
  const std::uint32_t first = fixture.add({1, 1, 1}, Endpoint::node(0));
  fixture.add({60, 1, 1}, Endpoint::node(1));
  StateRelay relay(fixture.state(), fixture.exchange());
  relay.begin();
  relay.publish(false);
  publish(fixture, 0, 1);
  fixture.state().nodes[0].lost = true;
  fixture.state().objects.set_host(first, Endpoint::server());
  relay.publish(true);
  publish(fixture, 1, 2);
  REQUIRE(is_ready(relay, fixture));
  relay.allow_reading();
  CHECK(published(fixture.publications().server, 1) == std::vector<ObjectNumber>{1});
  CHECK(fixture.publications().relays[1] ==
        std::vector<const Published*>{&fixture.publications().server, &fixture.publication(1).published});
}

TEST_CASE("publications do not change after users were allowed to read, though a node is lost") {
  ServerFixture fixture(publishing);
  fixture.connect(0);
  const std::uint32_t first = fixture.add({1, 1, 1}, Endpoint::node(0));
  StateRelay relay(fixture.state(), fixture.exchange());
  relay.begin();
  relay.publish(false);
  publish(fixture, 0, 1);
  fixture.state().nodes[1].received.published = true;
  relay.allow_reading();
  const auto listed = fixture.publications().relays[1];
  fixture.state().nodes[0].lost = true;
  fixture.state().objects.set_host(first, Endpoint::server());
  relay.publish(true);
  CHECK(!is_ready(relay, fixture));
  CHECK(fixture.publications().relays[1] == listed);
  CHECK(!fixture.publications().server.any[1]);
}

TEST_CASE("nothing is published while no user is connected") {
  ServerFixture fixture(publishing);
  fixture.add({1, 1, 1}, Endpoint::node(0));
  StateRelay relay(fixture.state(), fixture.exchange());
  relay.begin();
  CHECK(!fixture.publication(0).wanted);
  relay.publish(false);
  relay.allow_reading();
  CHECK(fixture.publications().relays[1].empty());
}

/// Frame after frame in one fixture, with node 0 as the host of all.
struct RelayRun {
  RelayRun() { fixture.connect(0); }
  /// The objects that the server publishes in the next frame.
  std::vector<ObjectNumber> next() {
    relay.begin();
    relay.publish(false);
    const auto numbers = published(fixture.publications().server, fixture.state().frame);
    fixture.state().objects.settle();
    ++fixture.state().frame;
    return numbers;
  }
  ServerFixture fixture{{.interest = 8}};
  StateRelay relay{fixture.state(), fixture.exchange()};
};

TEST_CASE("an object that moved, and one that is new, are published at their present positions") {
  RelayRun run;
  const std::uint32_t mover = run.fixture.add({1, 1, 1}, Endpoint::node(0));
  CHECK(run.next() == std::vector<ObjectNumber>{1});
  run.fixture.state().objects.change_row(mover).pose.position = {60, 60, 60};
  run.fixture.state().objects.mark_moved(mover);
  run.fixture.add({60, 60, 61}, Endpoint::node(0));
  CHECK(run.next() == std::vector<ObjectNumber>{1, 2});
  const geometry::CornerBox bounds = run.fixture.publications().server.bounds[0];
  CHECK(bounds.lower == Vec3d{60, 60, 60});
  CHECK(bounds.upper == Vec3d{60, 60, 61});
}

TEST_CASE("an object is not published while it is disabled, and is again afterwards") {
  RelayRun run;
  const std::uint32_t slot = run.fixture.add({1, 1, 1}, Endpoint::node(0));
  run.fixture.add({2, 1, 1}, Endpoint::node(0));
  ObjectTable& objects = run.fixture.state().objects;
  CHECK(run.next() == std::vector<ObjectNumber>{1, 2});
  for (const bool present : {false, true, false, true}) {
    objects.change_row(slot).object.flags = present ? messages::flag_present : 0u;
    objects.mark_moved(slot);
    const std::vector<ObjectNumber> expected = present ? std::vector<ObjectNumber>{1, 2} : std::vector<ObjectNumber>{2};
    CHECK(run.next() == expected);
    CHECK(run.next() == expected);
  }
}

}  // namespace
}  // namespace ringfence::nodes::test
