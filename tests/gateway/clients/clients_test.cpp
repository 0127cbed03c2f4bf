#include "gateway/clients/clients.hpp"

#include <algorithm>
#include <cmath>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include <doctest/doctest.h>
#include <nlohmann/json.hpp>

#include "gateway/client/replica.hpp"
#include "gateway/clients/fake_transport.hpp"
#include "motion/walk.hpp"

namespace ringfence::gateway {
namespace {

using Bytes = std::vector<std::byte>;

/// A world with a wall at x = 5, in which avatars appear in a row at y = 2 * user number, and its clients.
class Served {
 public:
  explicit Served(double grace_s = 1, std::uint32_t nodes = 0, Deployment deployment = Deployment::user_collision)
      : world_(world_config(nodes, deployment)),
        config_(gateway_config(grace_s)),
        ball_(world_.add_shape(Sphere{0.5f})),
        clients_(world_, config_, transport, [](UserId user) { return "guest " + std::to_string(user.number()); }) {
    const ShapeId wall = world_.add_shape(Box{{0.5f, 20, 2}});
    ObjectSpec spec;
    spec.number = 1000;
    spec.shape = wall;
    spec.category = Category::fixed;
    spec.pose.position = {5, 0, 0};
    CHECK(world_.spawn(spec).status == Status::ok);
    frame();
  }

  void frame() {
    clients_.before_frame();
    CHECK(world_.advance() == Status::ok);
    clients_.after_frame();
  }
  void frames(int count) {
    for (int i = 0; i < count; ++i) frame();
  }
  /// Applies the updates that a connection has received, and acknowledges them.
  void update(ConnectionId connection, Replica& replica) {
    for (const Bytes& message : transport.take(connection, ServerMessageType::update)) {
      REQUIRE(read(message, update_));
      CHECK(replica.apply(update_) == Replica::Outcome::applied);
    }
    transport.client_sends(connection, Ack{replica.acknowledgement()});
  }
  Welcome welcome(ConnectionId connection) {
    messages_ = transport.take(connection, ServerMessageType::welcome);
    REQUIRE(messages_.size() == 1);
    Welcome welcome;
    REQUIRE(read(messages_[0], welcome));
    return welcome;
  }
  World& world() { return world_; }
  Clients& clients() { return clients_; }
  GatewayConfig& config() { return config_; }
  const Update& last_update() const { return update_; }
  std::vector<std::pair<UserId, Bytes>> received;
  std::vector<UserId> left;
  FakeTransport transport;

 private:
  static WorldConfig world_config(std::uint32_t nodes, Deployment deployment) {
    WorldConfig config;
    config.nodes = nodes;
    config.deployment = deployment;
    config.bounds_min = {-50, -50, 0};
    config.bounds_max = {50, 50, 3};
    config.interest = 10;
    config.deadlines.node_ms = nodes == 0 ? 0 : 500;
    motion::WalkConfig walk;
    walk.bounds_min = config.bounds_min;
    walk.bounds_max = config.bounds_max;
    config.motion = std::make_shared<motion::Walk>(walk);
    return config;
  }
  GatewayConfig gateway_config(double grace_s) {
    GatewayConfig config;
    config.grace_s = grace_s;
    config.hooks.spawn = [this](UserId user) {
      ObjectSpec spec;
      spec.shape = ball_;
      spec.category = Category::avatar;
      spec.user = user;
      spec.pose.position = {0, 2.0 * user.number(), 0};
      return world_.spawn(spec).id;
    };
    config.hooks.left = [this](UserId user) { left.push_back(user); };
    config.hooks.application = [this](UserId user, std::span<const std::byte> bytes) {
      received.emplace_back(user, Bytes(bytes.begin(), bytes.end()));
    };
    config.hooks.metadata = [](ObjectNumber number, Bytes& bytes) {
      bytes.assign(number == 1000 ? 100 : 0, std::byte{7});
    };
    return config;
  }

  World world_;
  GatewayConfig config_;
  ShapeId ball_;
  Clients clients_;
  Update update_;
  std::vector<Bytes> messages_;
};

Input walk_east(std::uint64_t ack, std::uint64_t sequence) {
  motion::WalkInput wish;
  wish.x = 127;
  static Bytes body;
  const auto bytes = wish.bytes();
  body.assign(bytes.begin(), bytes.end());
  return {ack, sequence, 7, body};
}

}  // namespace

TEST_CASE("a player is welcomed, sees what is near, and an input moves its avatar from the next frame on") {
  Served served;
  const ConnectionId player = served.transport.open(Role::play);
  served.frame();
  const Welcome welcome = served.welcome(player);
  CHECK(welcome.user == UserId(0));
  CHECK(welcome.model == "walk");
  CHECK(welcome.interest == 10);
  CHECK(welcome.token == "guest 0");
  Replica replica;
  served.update(player, replica);
  REQUIRE(replica.own().has_value());
  CHECK(replica.own()->number == welcome.avatar);
  REQUIRE(replica.objects().contains(1000));
  CHECK(replica.objects().at(1000).category == Category::fixed);
  CHECK(replica.objects().at(1000).metadata.size() == max_metadata_bytes);
  const double before = replica.own()->pose.position.x;
  served.transport.client_sends(player, walk_east(replica.acknowledgement(), 1));
  served.frame();
  served.update(player, replica);
  CHECK(replica.own()->pose.position.x > before);
  CHECK(served.last_update().sequence == 1);
  CHECK(served.last_update().age == 0);
  CHECK(served.last_update().echo == 7);
  served.frame();
  served.update(player, replica);
  CHECK(served.last_update().age == 1);
}

TEST_CASE("an input holds until the next one, and a wall stops the avatar, which has the contact") {
  Served served;
  const ConnectionId player = served.transport.open(Role::play);
  served.frame();
  Replica replica;
  served.update(player, replica);
  served.transport.client_sends(player, walk_east(replica.acknowledgement(), 1));
  served.frames(80);
  served.update(player, replica);
  // The wall begins at 4.5, and the avatar has a radius of 0.5. An overlap of up to 2 cm is not resolved.
  CHECK(replica.own()->pose.position.x > 3.9);
  CHECK(replica.own()->pose.position.x < 4.1);
  REQUIRE(replica.contacts().size() == 1);
  CHECK(replica.contacts()[0].other == 1000);
  CHECK(replica.contacts()[0].phase == Phase::persist);
  CHECK(replica.contacts()[0].normal.x == 127);
  CHECK(replica.contacts()[0].age > 10);
}

TEST_CASE("players see each other only within the interest, in every deployment") {
  for (const Deployment deployment : {Deployment::user, Deployment::user_server, Deployment::user_collision}) {
    CAPTURE(name_of(deployment));
    Served served(1, 2, deployment);
    std::vector<ConnectionId> players;
    std::vector<Replica> replicas(12);
    for (int i = 0; i < 12; ++i) players.push_back(served.transport.open(Role::play));
    served.frames(2);
    for (std::size_t i = 0; i < players.size(); ++i) {
      served.update(players[i], replicas[i]);
      for (std::size_t j = 0; j < players.size(); ++j) {
        if (i == j) continue;
        const double distance = 2 * std::abs(static_cast<double>(i) - static_cast<double>(j));
        const auto& objects = replicas[i].objects();
        const bool sees = std::ranges::any_of(
            objects, [&](const auto& each) { return each.second.user == UserId(static_cast<std::uint32_t>(j)); });
        CHECK(sees == (distance <= 10));
      }
    }
  }
}

TEST_CASE("a new connection of a user replaces the old one and gets its avatar") {
  Served served;
  const ConnectionId first = served.transport.open(Role::play, UserId(7));
  served.frame();
  const ObjectNumber avatar = served.welcome(first).avatar;
  const ConnectionId second = served.transport.open(Role::play, UserId(7));
  served.frame();
  REQUIRE(served.transport.closed(first) != nullptr);
  CHECK(served.transport.closed(first)->code == CloseCode::replaced);
  CHECK(served.welcome(second).avatar == avatar);
  served.transport.client_closes(first);  // what the transport reports afterwards
  served.frame();
  Replica replica;
  served.update(second, replica);
  CHECK(replica.own().has_value());
  CHECK(served.clients().counts().players == 1);
}

TEST_CASE("an avatar stays for the grace period, stands still, and then is gone") {
  Served served(0.5);  // ten frames
  const ConnectionId player = served.transport.open(Role::play, UserId(3));
  served.frame();
  const ObjectNumber avatar = served.welcome(player).avatar;
  served.transport.client_sends(player, walk_east(0, 1));
  served.frames(3);
  served.transport.client_closes(player);
  served.frames(4);
  CHECK(served.clients().counts().away == 1);
  const auto position = [&] { return served.world().object(served.world().find(avatar)).spec.pose.position; };
  const Vec3d stands = position();
  served.frame();
  CHECK(position() == stands);
  const ConnectionId again = served.transport.open(Role::play, UserId(3));
  served.frame();
  CHECK(served.welcome(again).avatar == avatar);
  served.transport.client_closes(again);
  served.frames(14);
  CHECK_FALSE(served.world().find(avatar));
  CHECK(served.left == std::vector{UserId(3)});
  CHECK(served.clients().counts().away == 0);
}

TEST_CASE("messages that are malformed, of another role, or acknowledge the future end the connection with a reason") {
  Served served;
  const auto check_closed = [&](ConnectionId connection) {
    served.frame();
    REQUIRE(served.transport.closed(connection) != nullptr);
    CHECK(served.transport.closed(connection)->code == CloseCode::malformed);
    CHECK_FALSE(served.transport.closed(connection)->reason.empty());
  };
  const auto player = [&] {
    const ConnectionId connection = served.transport.open(Role::play);
    served.frame();
    return connection;
  };
  ConnectionId connection = player();
  served.transport.client_sends_bytes(connection, {std::byte{99}});
  check_closed(connection);
  connection = player();
  served.transport.client_sends(connection, Hello{});
  check_closed(connection);
  connection = player();
  served.transport.client_sends(connection, Ack{1000});
  check_closed(connection);
  connection = player();
  served.transport.client_sends(connection, View{{0, 0, 0}, 1});
  check_closed(connection);
  connection = player();
  served.transport.client_sends(connection, Command{Command::Kind::resize, 2});
  check_closed(connection);
  const ConnectionId spectator = served.transport.open(Role::watch);
  served.frame();
  served.transport.client_sends(spectator, walk_east(0, 1));
  check_closed(spectator);
  const ConnectionId watcher = served.transport.open(Role::watch);
  served.frame();
  served.transport.client_sends(watcher, Command{Command::Kind::robots, 2});
  check_closed(watcher);
  CHECK(served.clients().refused() == 7);
}

TEST_CASE("shapes, descriptions and application messages are answered") {
  Served served;
  const ConnectionId player = served.transport.open(Role::play);
  served.frame();
  Replica replica;
  served.update(player, replica);
  served.transport.client_sends(player, GetShape{replica.objects().at(1000).shape});
  served.transport.client_sends(player, GetShape{ShapeId(77)});
  served.transport.client_sends(player, Describe{1000});
  served.transport.client_sends(player, Describe{5000});
  const Bytes hello(5, std::byte{1});
  served.transport.client_sends(player, Application{hello});
  served.frame();
  const auto shapes = served.transport.take(player, ServerMessageType::shape);
  REQUIRE(shapes.size() == 2);
  ShapeId id;
  std::optional<ShapeDescription> shape;
  REQUIRE(read_shape(shapes[0], id, shape));
  REQUIRE(shape.has_value());
  CHECK(std::get<Box>(*shape).half_extents == Vec3f{0.5f, 20, 2});
  REQUIRE(read_shape(shapes[1], id, shape));
  CHECK_FALSE(shape.has_value());
  const auto described = served.transport.take(player, ServerMessageType::described);
  REQUIRE(described.size() == 2);
  const auto json = [](const Bytes& message) {
    return nlohmann::json::parse(std::string(reinterpret_cast<const char*>(message.data()) + 1, message.size() - 1));
  };
  CHECK(json(described[0]).at("category") == "static");
  CHECK_FALSE(json(described[1]).contains("category"));
  REQUIRE(served.received.size() == 1);
  CHECK(served.received[0].second == hello);
  CHECK(served.clients().send(UserId(0), hello));
  CHECK_FALSE(served.clients().send(UserId(9), hello));
  served.frame();
  CHECK(served.transport.take(player, ServerMessageType::application).size() == 1);
}

TEST_CASE("a spectator sees the whole world, or the part that it asks for, and the status") {
  Served served;
  const ConnectionId player = served.transport.open(Role::play);
  const ConnectionId spectator = served.transport.open(Role::watch);
  served.frames(40);
  Replica replica;
  served.update(spectator, replica);
  CHECK(replica.objects().size() == 2);
  CHECK_FALSE(replica.own().has_value());
  const auto statuses = served.transport.take(spectator, ServerMessageType::status);
  REQUIRE(statuses.size() >= 1);
  const std::string text(reinterpret_cast<const char*>(statuses[0].data()) + 1, statuses[0].size() - 1);
  const nlohmann::json status = nlohmann::json::parse(text);
  CHECK(status.at("objects") == 2);
  CHECK(status.at("clients") == 2);
  CHECK(status.at("regions").at("nodes").size() == 64 * 64);
  served.transport.client_sends(spectator, View{{5, 0, 0}, 1});
  served.frames(4);
  served.update(spectator, replica);
  CHECK(replica.objects().size() == 1);
  CHECK(replica.objects().contains(1000));
  CHECK(served.transport.closed(player) == nullptr);
}

TEST_CASE("a spectator receives a status at once, and after each change of the number of nodes") {
  Served served(1, 2);
  const ConnectionId spectator = served.transport.open(Role::watch);
  served.frame();
  CHECK(served.transport.take(spectator, ServerMessageType::status).size() == 1);
  served.frame();
  CHECK(served.transport.take(spectator, ServerMessageType::status).empty());
  REQUIRE(served.world().resize(3) == Status::ok);
  for (int i = 0; i < 10 && served.world().report().nodes.size() < 3; ++i) served.frame();
  REQUIRE(served.world().report().frame < 15);  // before the status of the first second
  const auto statuses = served.transport.take(spectator, ServerMessageType::status);
  REQUIRE(statuses.size() == 1);
  const std::string text(reinterpret_cast<const char*>(statuses[0].data()) + 1, statuses[0].size() - 1);
  CHECK(nlohmann::json::parse(text).at("nodes").size() == 3);
}

TEST_CASE("a spectator receives the pairs that touch in its view") {
  Served served;
  const ConnectionId player = served.transport.open(Role::play);
  const ConnectionId spectator = served.transport.open(Role::watch);
  served.frame();
  Replica replica, of_player;
  served.update(player, of_player);
  served.transport.client_sends(player, walk_east(of_player.acknowledgement(), 1));
  served.frames(80);  // the avatar has reached the wall
  served.update(spectator, replica);
  std::vector<std::pair<ObjectNumber, ObjectNumber>> expected;
  for (const Contact& contact : served.world().contacts()) {
    if (contact.phase != Phase::end) expected.emplace_back(contact.a, contact.b);
  }
  REQUIRE(expected.size() == 1);
  const auto touching = [&] {
    std::vector<std::pair<ObjectNumber, ObjectNumber>> pairs;
    for (const auto [a, b] : replica.touching()) pairs.emplace_back(a, b);
    return pairs;
  };
  CHECK(touching() == expected);
  served.transport.client_sends(spectator, View{{-500, 0, 0}, 1});
  served.frames(4);
  served.update(spectator, replica);
  CHECK(touching().empty());
  served.update(player, of_player);
  CHECK(of_player.contacts().size() == 1);
  CHECK(of_player.touching().empty());
}

TEST_CASE("a world without a hook for avatars has spectators only") {
  Served served;
  served.config().hooks.spawn = nullptr;
  const ConnectionId player = served.transport.open(Role::play);
  const ConnectionId spectator = served.transport.open(Role::watch);
  served.frame();
  REQUIRE(served.transport.closed(player) != nullptr);
  CHECK(served.transport.closed(player)->code == CloseCode::forbidden);
  CHECK(served.transport.closed(spectator) == nullptr);
}

TEST_CASE("an operator kills a node, and players keep their contacts") {
  Served served(1, 3);
  const ConnectionId player = served.transport.open(Role::play);
  const ConnectionId operating = served.transport.open(Role::operate);
  served.frame();
  Replica replica;
  served.update(player, replica);
  served.transport.client_sends(player, walk_east(replica.acknowledgement(), 1));
  served.frames(80);
  served.transport.client_sends(operating, Command{Command::Kind::kill, 1});
  served.frame();
  CHECK(served.world().report().lost == std::vector{NodeId(1)});
  CHECK(served.transport.take(operating, ServerMessageType::notice).size() == 1);
  served.frame();
  served.update(player, replica);
  REQUIRE(replica.contacts().size() == 1);
  CHECK(replica.contacts()[0].phase == Phase::persist);
  served.transport.client_sends(operating, Command{Command::Kind::resize, 4});
  served.frames(2);
  CHECK(served.world().nodes() == 4);
}

TEST_CASE("a client that never acknowledges still gets complete updates, and its table stays small") {
  Served served;
  const ConnectionId player = served.transport.open(Role::play);
  served.frames(100);
  const auto updates = served.transport.take(player, ServerMessageType::update);
  REQUIRE(updates.size() == 100);
  for (const Bytes& message : updates) {
    Replica replica;
    Update update;
    REQUIRE(read(message, update));
    CHECK(update.since == 0);
    CHECK(replica.apply(update) == Replica::Outcome::applied);
    CHECK(replica.objects().size() == 1);
  }
}

TEST_CASE("a player of a restored world comes back to its avatar") {
  MemorySink sink;
  ObjectNumber avatar = 0;
  WorldConfig config;
  {
    Served served;
    const ConnectionId player = served.transport.open(Role::play, UserId(11));
    served.frame();
    avatar = served.welcome(player).avatar;
    config = served.world().config();
    REQUIRE(served.world().save(sink) == Status::ok);
  }
  MemorySource source(sink.bytes());
  World world(config, source);
  GatewayConfig gateway;
  gateway.hooks.spawn = [](UserId) { return ObjectId{}; };
  FakeTransport transport;
  Clients clients(world, gateway, transport, [](UserId) { return std::string(); });
  CHECK(clients.counts().away == 1);
  const ConnectionId player = transport.open(Role::play, UserId(11));
  const ConnectionId other = transport.open(Role::play, UserId(12));
  clients.before_frame();
  REQUIRE(world.advance() == Status::ok);
  clients.after_frame();
  const auto messages = transport.take(player, ServerMessageType::welcome);
  REQUIRE(messages.size() == 1);
  Welcome welcome;
  REQUIRE(read(messages[0], welcome));
  CHECK(welcome.avatar == avatar);
  REQUIRE(transport.closed(other) != nullptr);
  CHECK(transport.closed(other)->code == CloseCode::full);
}

}  // namespace ringfence::gateway
