#include "nodes/server/frame/cut.hpp"

#include <algorithm>

#include <doctest/doctest.h>

#include "nodes/server/frame/frame_opening.hpp"
#include "nodes/server/server_fixture.hpp"

namespace ringfence::nodes::test {
namespace {

struct Cuts {
  explicit Cuts(const FixtureConfig& config = {}) : fixture(config) {}
  ServerState& state() { return fixture.state(); }
  ObjectTable& objects() { return fixture.state().objects; }
  base::SystemVector<Request>& requests() { return fixture.order().requests; }
  Request& request(Request::Kind kind, ObjectNumber number = 0) {
    Request& request = requests().emplace_back();
    request.kind = kind;
    request.object = ObjectId::of(number, 1);
    request.spec.number = number;
    request.spec.shape = ShapeId(0);
    return request;
  }
  /// One cut; the requests are done after it.
  void cut() {
    cuts.begin();
    cuts.apply_requests();
    cuts.assign_hosts();
    cuts.list_known_contacts();
    opening.start_nodes();
    opening.start_users();
    requests().clear();
  }
  /// The types of the messages that open a peer's frame; `records` receives their numbers of records.
  std::vector<MessageType> open(Endpoint peer, std::vector<std::uint32_t>* records = nullptr) {
    REQUIRE((peer.is_user() ? opening.open_users() : opening.open(*state().session_of(peer))));
    std::vector<MessageType> types;
    for (const SentMessage& message : fixture.sent_to(peer)) {
      types.push_back(message.type());
      if (records != nullptr) records->push_back(message.header.count);
    }
    return types;
  }

  ServerFixture fixture;
  ObjectStates states{fixture.state(), fixture.exchange()};
  MapScheduler scheduler{fixture.state(), fixture.exchange(), states};
  Dispatch dispatch{fixture.state()};
  Cut cuts{fixture.state(), fixture.exchange(), states, scheduler, dispatch};
  FrameOpening opening{fixture.state(), fixture.exchange()};
};

using Types = std::vector<MessageType>;

TEST_CASE("a new object is adopted by the node that owns its position, before that node's frame begins") {
  Cuts test;
  test.request(Request::Kind::spawn, 7).spec.pose.position = {60, 1, 1};
  test.cut();
  const std::uint32_t slot = test.objects().find(7);
  REQUIRE(slot != base::NumberIndex::none);
  CHECK(test.objects().host(slot) == Endpoint::node(1));
  CHECK(test.objects().bounds()[slot] ==
        test.state().setup.shapes->bounds(0, test.objects().row(slot).pose, *test.state().setup.space));
  CHECK(test.open(Endpoint::node(0)) == Types{MessageType::frame_begin});
  CHECK(test.open(Endpoint::node(1)) == Types{MessageType::adopt, MessageType::frame_begin});
  test.cut();
  CHECK(test.open(Endpoint::node(1)) == Types{MessageType::frame_begin});
}

TEST_CASE("a user thread without room does not delay the frame of the user nodes of other threads") {
  Cuts test;
  for (const UserNumber user : {0u, 1u}) {
    test.fixture.connect(user);
    Request& avatar = test.request(Request::Kind::spawn, 7 + user);
    avatar.spec.category = Category::avatar;
    avatar.spec.user = UserId(user);
  }
  test.cut();
  test.fixture.fill(Endpoint::user(0));
  const auto types_to = [&](UserNumber user) {
    Types types;
    for (const SentMessage& message : test.fixture.sent_to(Endpoint::user(user))) types.push_back(message.type());
    return types;
  };
  CHECK(!test.opening.open_users());
  CHECK(types_to(1) == Types{MessageType::adopt, MessageType::frame_begin});
  types_to(0);  // makes room
  CHECK(test.opening.open_users());
  CHECK(types_to(0) == Types{MessageType::adopt, MessageType::frame_begin});
  CHECK(types_to(1).empty());
}

TEST_CASE("requests apply in the order of the calls, and those for objects that are gone do nothing") {
  Cuts test;
  test.request(Request::Kind::spawn, 7).spec.pose.position = {1, 1, 1};
  test.cut();
  test.open(Endpoint::node(0));
  test.request(Request::Kind::place, 7).spec.pose.position = {2, 1, 1};
  test.request(Request::Kind::place, 7).spec.pose.position = {3, 1, 1};
  test.request(Request::Kind::set_enabled, 7).spec.enabled = false;
  test.request(Request::Kind::place, 8);
  Request& stale = test.request(Request::Kind::destroy, 7);
  stale.object = ObjectId::of(7, 2);
  test.cut();
  const std::uint32_t slot = test.objects().find(7);
  REQUIRE(slot != base::NumberIndex::none);
  CHECK(test.objects().row(slot).pose.position.x == 3);
  CHECK(test.objects().present()[slot] == 0);
  std::vector<std::uint32_t> records;
  CHECK(test.open(Endpoint::node(0), &records) == Types{MessageType::place, MessageType::frame_begin});
  CHECK(records[0] == 3);
  test.request(Request::Kind::destroy, 7);
  test.request(Request::Kind::place, 7);
  test.cut();
  CHECK(test.objects().find(7) == base::NumberIndex::none);
  CHECK(test.open(Endpoint::node(0)) == Types{MessageType::drop, MessageType::frame_begin});
}

TEST_CASE("a user that leaves takes its avatars with it, and a user that comes is awaited") {
  Cuts test;
  Request& connect = test.request(Request::Kind::connect);
  connect.user = 2;
  connect.connection = test.fixture.connection(Endpoint::user(2));
  Request& spawn = test.request(Request::Kind::spawn, 7);
  spawn.spec.category = Category::avatar;
  spawn.spec.user = UserId(2);
  test.cut();
  CHECK(test.state().connected == std::vector<UserNumber>{2});
  CHECK(test.state().awaited_users == 1);
  CHECK(test.objects().host(test.objects().find(7)) == Endpoint::user(2));
  CHECK(test.open(Endpoint::user(2)) == Types{MessageType::adopt, MessageType::frame_begin});
  test.request(Request::Kind::disconnect).user = 2;
  test.cut();
  CHECK(test.objects().find(7) == base::NumberIndex::none);
  CHECK(test.state().awaited_users == 0);
  CHECK(test.state().session_of(Endpoint::user(2)) == nullptr);
}

TEST_CASE("the slot of a node that was lost or has left is free, and a later node takes it with its own id") {
  Cuts test({.nodes = 3});
  test.state().nodes[0].lost = true;
  test.state().nodes[2].left = true;
  CHECK(test.cuts.begin());
  CHECK(test.state().nodes.size() == 2);  // the last slot is not needed any more
  CHECK(!test.state().nodes[0].connected);
  CHECK(!test.cuts.begin());
  Request& join = test.request(Request::Kind::add_node);
  join.node = 0;
  join.node_id = 9;
  join.connection = test.fixture.connection(Endpoint::node(0));
  test.cuts.apply_requests();
  CHECK(test.state().nodes[0].is_active());
  CHECK(test.state().nodes[0].id == 9);
}

TEST_CASE("a host that did not have an object receives the object's contacts of the frame before, each once") {
  Cuts test;
  const std::uint32_t a = test.fixture.add({1, 1, 1}, Endpoint::node(1));
  const std::uint32_t b = test.fixture.add({1.5, 1, 1}, Endpoint::node(1));
  const std::uint32_t c = test.fixture.add({2, 1, 1}, Endpoint::node(0));
  ContactLedger& ledger = test.state().ledger;
  messages::CollisionRecord record;
  for (const auto& [first, second] : {std::pair{a, b}, std::pair{b, c}}) {
    record.slot_a = first;
    record.slot_b = second;
    REQUIRE(ledger.receive(0, record, test.objects().contact_objects()));
  }
  ledger.end_run(0, test.objects().contact_objects());
  ledger.end_run(1, test.objects().contact_objects());
  ledger.resolve_phases();
  ledger.share_out();
  test.state().frame = 2;
  test.state().note_host_change(a);
  test.state().note_host_change(b);
  test.cut();
  std::vector<std::uint32_t> records;
  CHECK(test.open(Endpoint::node(1), &records) == Types{MessageType::notify, MessageType::frame_begin});
  CHECK(records[0] == 2);
  CHECK(test.open(Endpoint::node(0)) == Types{MessageType::frame_begin});
  CHECK(test.state().host_changes.empty());
  CHECK((test.objects().marks(a) & host_changed_mark) == 0);
}

TEST_CASE("a map that precedes the frame comes first, and refused records of the frame before go back to their user") {
  Cuts test;
  test.fixture.connect(0);
  test.state().users[0].received.refusals.push_back({7, static_cast<std::uint32_t>(Status::not_host)});
  test.state().refused_users.push_back(0);
  test.state().map_change.precedes_frame = true;
  test.cut();
  CHECK(test.state().refused_users.empty());
  CHECK(test.open(Endpoint::node(0)) == Types{MessageType::region_map, MessageType::frame_begin});
  CHECK(test.open(Endpoint::user(0)) == Types{MessageType::refused, MessageType::frame_begin});
  test.state().map_change.precedes_frame = false;
  test.cut();
  CHECK(test.open(Endpoint::user(0)) == Types{MessageType::frame_begin});
}

}  // namespace
}  // namespace ringfence::nodes::test
