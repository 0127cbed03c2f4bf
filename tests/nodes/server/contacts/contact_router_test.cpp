#include "nodes/server/contacts/contact_router.hpp"

#include <array>
#include <cstring>

#include <doctest/doctest.h>

#include "nodes/server/server_fixture.hpp"

namespace ringfence::nodes::test {
namespace {

struct Router {
  explicit Router(const FixtureConfig& config = {}) : fixture(config) {}
  ServerState& state() { return fixture.state(); }
  ObjectTable& objects() { return fixture.state().objects; }
  /// The node sends a contact of two slots.
  void find(NodeNumber node, std::uint32_t a, std::uint32_t b) {
    messages::CollisionRecord record;
    record.slot_a = a;
    record.slot_b = b;
    REQUIRE(state().ledger.receive(node, record, objects().contact_objects()));
  }
  /// The node's contact of the frame before, in slots a and b, ended.
  void end(NodeNumber node, std::uint32_t a, std::uint32_t b) {
    messages::ChangeRecord record;
    record.key = base::PairSort::key(objects().row(a).object.number, objects().row(b).object.number);
    record.flags = messages::change_ended;
    REQUIRE(state().ledger.receive(node, record));
  }
  /// All nodes have tested their pairs: routes the contacts and notifies all peers.
  void route() {
    for (NodeNumber node = 0; node < state().nodes.size(); ++node)
      state().ledger.end_run(node, objects().contact_objects());
    router.resolve_phases();
    router.assign_next_hosts();
    router.start_nodes();
    CHECK(state().all_nodes([&](PeerSession& node) { return router.notify(node); }));
    for (UserConnection& peers : state().user_connections) peers.end_run.start(0);
    router.start_users();
    CHECK(router.notify_users());
    REQUIRE(state().ledger.complete());
    router.count_contacts();
  }
  /// The contacts in the messages that were sent to a peer; all of its other messages go to `others`.
  std::vector<Contact> notified(Endpoint peer, std::vector<SentMessage>* others = nullptr) {
    std::vector<Contact> contacts;
    for (const SentMessage& message : fixture.sent_to(peer)) {
      for (std::size_t i = 0; message.type() == MessageType::notify && i < message.header.count; ++i) {
        contacts.push_back(message.record<Contact>(i));
      }
      if (message.type() != MessageType::notify && others != nullptr) {
        others->push_back(message);
      }
    }
    return contacts;
  }

  ServerFixture fixture;
  ObjectStates states{fixture.state(), fixture.exchange()};
  StateRelay relay{fixture.state(), fixture.exchange()};
  Statistics statistics{fixture.state()};
  ContactRouter router{fixture.state(), fixture.exchange(), states, relay, statistics};
};

TEST_CASE("a contact goes from the server to the user node that hosts one of its objects, and to no CD node") {
  Router test;
  test.fixture.connect(0);
  test.fixture.connect(1);
  const std::uint32_t avatar = test.fixture.add({31, 1, 1}, Endpoint::user(0), Category::avatar);
  const std::uint32_t first = test.fixture.add({31.5, 1, 1}, Endpoint::node(0));
  const std::uint32_t second = test.fixture.add({32.1, 1, 1}, Endpoint::node(1));
  test.find(0, avatar, first);
  test.find(0, first, second);
  test.route();
  CHECK(test.notified(Endpoint::node(0)).empty());
  CHECK(test.notified(Endpoint::node(1)).empty());
  const auto to_user = test.notified(Endpoint::user(0));
  REQUIRE(to_user.size() == 1);
  CHECK(to_user[0].a == test.objects().row(avatar).object.number);
  const auto to_other = test.fixture.sent_to(Endpoint::user(1));
  REQUIRE(to_other.size() == 1);  // without contacts, only the end
  CHECK(to_other[0].header.destination == Endpoint::all_users().value);
  CHECK(to_other[0].header.count == 0);
  CHECK(test.state().report().contacts == 2);
  CHECK(!test.state().users_are_done());
  CHECK(!test.router.notify_users());  // once
}

TEST_CASE("a user thread without room does not delay the contacts of the user nodes of other threads") {
  Router test({.nodes = 1});
  for (const UserNumber user : {0u, 1u}) test.fixture.connect(user);
  const std::uint32_t first = test.fixture.add({1, 1, 1}, Endpoint::user(0), Category::avatar, 0);
  const std::uint32_t second = test.fixture.add({1.5, 1, 1}, Endpoint::user(1), Category::avatar, 1);
  test.find(0, first, second);
  test.fixture.fill(Endpoint::user(0));
  test.route();
  CHECK(test.notified(Endpoint::user(1)).size() == 1);
  CHECK(test.state().user_connections[1].end_run.done());
  CHECK(!test.state().user_connections[0].end_run.done());
  test.fixture.sent_to(Endpoint::user(0));  // makes room
  CHECK(test.router.notify_users());
  CHECK(test.notified(Endpoint::user(0)).size() == 1);
  CHECK(test.state().user_connections[0].end_run.done());
  CHECK(test.fixture.sent_to(Endpoint::user(1)).empty());
}

TEST_CASE("only user nodes receive ended contacts, in order with the others") {
  Router test({.nodes = 1});
  test.fixture.connect(0);
  const std::uint32_t avatar = test.fixture.add({1, 1, 1}, Endpoint::user(0), Category::avatar);
  const std::uint32_t leaves = test.fixture.add({1.5, 1, 1}, Endpoint::node(0));
  const std::uint32_t comes = test.fixture.add({0.5, 1, 1}, Endpoint::node(0));
  test.find(0, avatar, leaves);
  test.route();
  REQUIRE(test.notified(Endpoint::user(0)).size() == 1);
  test.notified(Endpoint::node(0));
  test.state().frame = 2;
  test.state().ledger.begin(2);
  test.find(0, avatar, comes);
  test.end(0, avatar, leaves);
  test.route();
  const auto contacts = test.notified(Endpoint::user(0));
  REQUIRE(contacts.size() == 2);
  CHECK(contacts[0].b == test.objects().row(leaves).object.number);
  CHECK(contacts[0].phase == Phase::end);
  CHECK(contacts[1].b == test.objects().row(comes).object.number);
  CHECK(contacts[1].phase != Phase::end);
  CHECK(test.notified(Endpoint::node(0)).empty());
  CHECK(test.state().report().ended == 1);
}

TEST_CASE("an object that left its region is handed over to the node that owns its position, which expects it") {
  Router test;
  const std::uint32_t leaver = test.fixture.add({33, 1, 1}, Endpoint::node(0));
  const std::uint32_t unreported = test.fixture.add({34, 1, 1}, Endpoint::node(0));
  test.state().leaving = {{leaver, 1}};
  test.route();
  CHECK(test.objects().host(leaver) == Endpoint::node(1));
  CHECK(test.objects().host(unreported) == Endpoint::node(0));
  REQUIRE(test.state().hand_overs.size() == 1);
  CHECK(test.state().hand_overs[0].from == 0);
  CHECK(test.state().report().handed_over == 1);
  std::vector<SentMessage> others;
  test.notified(Endpoint::node(1), &others);
  REQUIRE(others.size() == 1);
  CHECK(others[0].type() == MessageType::frame_end);
  CHECK(others[0].record<messages::FrameEndRecord>(0).hand_overs == 1);
}

TEST_CASE("the end of the frame announces what other nodes send directly") {
  Router test;
  const messages::CountRecord count{1, 17};
  alignas(8) std::array<std::byte, sizeof(messages::Header) + sizeof count> bytes;
  messages::write_header(bytes.data(), {MessageType::contact_counts, Endpoint::node(0), Endpoint::server(), 1, 1},
                         sizeof count, 1, true, 1);
  std::memcpy(bytes.data() + sizeof(messages::Header), &count, sizeof count);
  messages::MessageView view;
  REQUIRE(messages::decode(bytes, 0, view) == Status::ok);
  REQUIRE(test.fixture.exchange().receive_counts(test.state().nodes[0], view));
  test.route();
  std::vector<SentMessage> others;
  test.notified(Endpoint::node(1), &others);
  REQUIRE(others.size() == 1);
  CHECK(others[0].record<messages::FrameEndRecord>(0).contacts == 17);
}

TEST_CASE("under a new map every object may change its host, and nodes receive the map before the end of the frame") {
  Router test;
  const std::uint32_t slot = test.fixture.add({34, 1, 1}, Endpoint::node(0));
  test.fixture.connect(0);
  test.state().map_change.at_end = true;
  test.route();
  CHECK(test.objects().host(slot) == Endpoint::node(1));
  std::vector<SentMessage> others;
  test.notified(Endpoint::node(0), &others);
  REQUIRE(others.size() == 2);
  CHECK(others[0].type() == MessageType::region_map);
  CHECK(others[1].type() == MessageType::frame_end);
  others.clear();
  test.notified(Endpoint::user(0), &others);
  CHECK(others.empty());
}

TEST_CASE("if hosts exchange their objects, the server finds their next hosts in the hosts and keeps what changes") {
  Router test({.placement = Placement::region, .shares_memory = true});
  const std::uint32_t slot = test.fixture.add({10, 1, 1}, Endpoint::node(0));
  test.objects().settle();
  test.objects().marks(slot) |= host_owned_mark;
  const ObjectNumber number = test.objects().row(slot).object.number;
  Host& host = test.fixture.host(0);
  host.place(number, {{40, 1, 1}, {}}, true);  // moved, unknown to the table
  host.set_host_owned(host.find(number), true);
  test.state().map_change = {.at_end = true, .hosts_exchange_objects = true};
  test.router.assign_next_hosts();
  CHECK(test.objects().host(slot) == Endpoint::node(1));
  CHECK(test.objects().row(slot).pose.position.x == 40);
}

TEST_CASE("in other deployments the server hands nothing over") {
  Router test({.deployment = Deployment::user_server});
  const std::uint32_t slot = test.fixture.add({34, 1, 1}, Endpoint::server());
  test.state().leaving = {{slot, 1}};
  test.state().map_change.at_end = true;
  test.router.assign_next_hosts();
  CHECK(test.objects().host(slot).is_server());
  CHECK(test.state().hand_overs.empty());
}

}  // namespace
}  // namespace ringfence::nodes::test
