// Requests of a World without a World. tests/facade/refusal_test.cpp has all refusals.
#include "facade/requests/requests.hpp"

#include <array>
#include <cstddef>
#include <memory>
#include <vector>

#include <doctest/doctest.h>

namespace ringfence::facade {
namespace {

using nodes::Request;
using Kinds = std::vector<Request::Kind>;

/// Moves nothing; keeps two bytes for each object.
class TwoBytes : public MotionModel {
 public:
  std::size_t state_bytes() const noexcept override { return 2; }
  void move(std::uint64_t, std::span<const MotionInput>, std::span<MotionOutput>) const override {}
};

WorldConfig config_with_state() {
  WorldConfig config;
  config.motion = std::make_shared<TwoBytes>();
  return config;
}

struct Fixture {
  Kinds kinds() const {
    Kinds kinds;
    for (const Request& request : order.requests) kinds.push_back(request.kind);
    return kinds;
  }
  std::uint64_t refused(Status reason) {
    FrameReport report;
    requests.report_refused(report);
    return report.refused[static_cast<std::size_t>(reason)];
  }
  const WorldConfig config = config_with_state();
  geometry::ShapeTable shapes;
  const ShapeId ball{shapes.add(Sphere{1})};
  Requests requests{config, shapes};
  nodes::FrameOrder order;
};

TEST_CASE("a cut passes on the requests in the order of the calls, and later ones belong to the next cut") {
  Fixture fixture;
  Requests& requests = fixture.requests;
  const UserId user = requests.connect(no_user).user;
  const ObjectId avatar = requests.spawn({.shape = fixture.ball, .category = Category::avatar, .user = user}).id;
  const ObjectId other = requests.spawn({.shape = fixture.ball}).id;
  CHECK(requests.set_group(avatar, 3) == Status::ok);
  CHECK(requests.place(other, {{1, 2, 3}, {}}) == Status::ok);
  requests.cut(fixture.order);
  CHECK(requests.destroy(other) == Status::ok);
  using Kind = Request::Kind;
  CHECK(fixture.kinds() == Kinds{Kind::connect, Kind::spawn, Kind::spawn, Kind::set_group, Kind::place});
  CHECK(fixture.order.requests[1].object == avatar);
  CHECK(fixture.order.requests[4].object == other);
  CHECK(fixture.order.requests[4].spec.pose.position.y == 2);
  requests.forget_cut(fixture.order);
  Request first;
  first.kind = Kind::add_node;
  requests.add_first(first);
  requests.cut(fixture.order);
  CHECK(fixture.kinds() == Kinds{Kind::add_node, Kind::destroy});
}

TEST_CASE("the states of a cut lie where its requests say") {
  Fixture fixture;
  Requests& requests = fixture.requests;
  const ObjectId first = requests.spawn({.shape = fixture.ball}).id,
                 second = requests.spawn({.shape = fixture.ball}).id;
  const std::array<std::byte, 2> a{std::byte{1}, std::byte{2}}, b{std::byte{3}, std::byte{4}};
  CHECK(requests.set_state(first, a) == Status::ok);
  CHECK(requests.set_state(second, std::span(b).first(1)) == Status::bad_message);
  CHECK(requests.set_state(second, b) == Status::ok);
  requests.cut(fixture.order);
  const nodes::FrameOrder& order = fixture.order;
  REQUIRE(order.requests.size() == 4);
  CHECK(order.states[order.requests[2].state] == std::byte{1});
  CHECK(order.states[order.requests[3].state] == std::byte{3});
  CHECK(order.states.size() == 4);
}

TEST_CASE("a user that disconnects takes back its moves and inputs, and a disabled object its moves") {
  Fixture fixture;
  Requests& requests = fixture.requests;
  std::vector<UserId> users;
  std::vector<ObjectId> avatars;
  for (int i = 0; i < 3; ++i) {
    users.push_back(requests.connect(no_user).user);
    avatars.push_back(requests.spawn({.shape = fixture.ball, .category = Category::avatar, .user = users.back()}).id);
    CHECK(requests.move(users[i], avatars[i], Pose{}) == Status::ok);
    CHECK(requests.input(users[i], avatars[i], {}) == Status::ok);
  }
  CHECK(requests.disconnect(users[0]) == Status::ok);
  CHECK(requests.set_enabled(avatars[2], false) == Status::ok);
  requests.cut(fixture.order);
  const UserOrders& orders = requests.user_orders();
  REQUIRE(orders.moves.size() == 2);
  CHECK(orders.moves[0].number == avatars[1].number());
  CHECK(orders.moves[1].number == 0);  // does not count
  REQUIRE(orders.inputs.size() == 2);
  CHECK(orders.inputs[0].user == users[1].number());
  CHECK(orders.inputs[1].user == users[2].number());
  CHECK(requests.objects().find(avatars[0]) == nullptr);
}

TEST_CASE("a refused call changes nothing and is reported once") {
  Fixture fixture;
  Requests& requests = fixture.requests;
  const UserId user = requests.connect(no_user).user, other = requests.connect(no_user).user;
  const ObjectId avatar = requests.spawn({.shape = fixture.ball, .category = Category::avatar, .user = user}).id;
  CHECK(requests.move(other, avatar, Pose{}) == Status::not_host);
  CHECK(requests.destroy(other, avatar) == Status::not_host);
  CHECK(requests.spawn({.shape = ShapeId(9)}).status == Status::unknown_shape);
  CHECK(requests.user_orders().moves.empty());
  CHECK(requests.objects().live() == 1);
  CHECK(fixture.refused(Status::not_host) == 2);
  CHECK(fixture.refused(Status::not_host) == 0);
}

}  // namespace
}  // namespace ringfence::facade
