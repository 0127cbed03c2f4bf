// User nodes of a World without a server. tests/facade/lifetime_test.cpp has whole worlds with stalled models.
#include "facade/users/user_nodes.hpp"

#include <atomic>
#include <cstddef>
#include <thread>
#include <vector>

#include <doctest/doctest.h>

namespace ringfence::facade {
namespace {

using Numbers = std::vector<UserNumber>;

WorldConfig config_with(std::uint32_t nodes) {
  WorldConfig config;
  config.nodes = nodes;
  config.user_threads = 2;
  config.deadlines.user_ms = 1e-6;  // so that no time has to pass between two checks
  return config;
}

struct Fixture {
  explicit Fixture(std::uint32_t nodes = 0) : state(config_with(nodes)), users(state) {
    state.start_server_thread();
    users.start_threads();
  }
  // As a World does: all threads end before the roles that they step.
  ~Fixture() {
    users.each_worker([](Worker& worker) { worker.dismiss(); });
    users.each_worker([](Worker& worker) { worker.join(); });
  }
  void connect(const Numbers& numbers) {
    for (const UserNumber number : numbers) {
      nodes::Request request;
      request.kind = nodes::Request::Kind::connect;
      request.user = number;
      state.order.requests.push_back(request);
    }
    users.apply_requests();
  }
  Numbers numbers_in_time() const {
    Numbers numbers;
    users.each([&](const User& user) {
      for (UserNumber number = 0; number < 10; ++number) {
        if (users.find(number) == &user) numbers.push_back(number);
      }
    });
    return numbers;
  }
  std::size_t threads() const {
    std::size_t count = 0;
    users.each_worker([&](const Worker&) { ++count; });
    return count;
  }
  WorldState state;
  UserNodes users;
};

TEST_CASE("a user node that connects has a connection and a publication, which it shares with those of its thread") {
  Fixture fixture;
  fixture.connect({3, 1});
  for (const nodes::Request& request : fixture.state.order.requests) {
    CHECK(request.connection.out != nullptr);
    CHECK(request.connection.in != nullptr);
    CHECK(request.connection.publication != nullptr);
    CHECK(request.connection.publication == fixture.state.order.requests.front().connection.publication);
  }
  CHECK(fixture.numbers_in_time() == Numbers{1, 3});
  CHECK(fixture.users.find(2) == nullptr);
  CHECK(fixture.threads() == 0);
}

TEST_CASE("moves and inputs are cleared when they are passed to the user nodes") {
  Fixture fixture;
  fixture.connect({2});
  UserOrders orders;
  orders.moves.push_back({2, 1, Pose{}});
  orders.inputs.emplace_back().user = 2;
  fixture.users.steer(orders);
  CHECK(orders.moves.empty());
  CHECK(orders.inputs.empty());
}

TEST_CASE("a fault needs a connected user node, and a stage of user nodes") {
  Fixture fixture(1);
  fixture.connect({0, 1});
  Fault fault;
  fault.stage = NodeStage::model;
  fault.user = UserId(0);
  CHECK(fixture.users.inject(fault));
  fault.user = UserId(2);
  CHECK(!fixture.users.inject(fault));
  fault.user = UserId(0);
  fault.stage = NodeStage::moving;
  CHECK(!fixture.users.inject(fault));
}

/// A role whose step does not return until the test ends it.
struct Stuck {
  ~Stuck() { may_go = true; }
  nodes::Step step() {
    is_in = true;
    while (!may_go) std::this_thread::yield();
    return nodes::Step::idle;
  }
  std::atomic<bool> is_in{false}, may_go{false};
};

TEST_CASE("a stalled thread keeps the user node in whose move it is, and a new thread steps its others") {
  Fixture fixture(1);
  fixture.connect({0, 1, 2, 4});  // 0, 2 and 4 on the first thread
  Stuck stuck;
  UserThread& thread = fixture.users.threads().at(0);
  thread.worker->assign({Steppable::of(stuck)});
  thread.worker->bell().ring();
  while (!stuck.is_in) std::this_thread::yield();
  thread.watch.enter(2);
  nodes::FrameOrder& order = fixture.state.order;
  fixture.users.replace_stalled_threads();
  CHECK(!order.users_moved);
  fixture.users.replace_stalled_threads();
  REQUIRE(order.users_moved);
  CHECK(order.stalled_users == Numbers{2});
  REQUIRE(order.moved_connections.size() == 1);
  CHECK(order.moved_connections[0].connection.in == fixture.state.order.requests[0].connection.in);
  CHECK(order.moved_connections[0].bell == fixture.users.threads().bell(0));
  CHECK(fixture.numbers_in_time() == Numbers{0, 1, 4});
  CHECK(fixture.users.find(2)->late);
  Fault fault;
  fault.stage = NodeStage::model;
  fault.user = UserId(2);
  CHECK(!fixture.users.inject(fault));
  CHECK(fixture.threads() == 3);
  fixture.users.forget(Numbers{2});
  fixture.users.free_stalled();
  CHECK(fixture.threads() == 3);  // the stalled thread still runs
  stuck.may_go = true;
  while (fixture.threads() == 3) fixture.users.free_stalled();
  CHECK(fixture.threads() == 2);
}

}  // namespace
}  // namespace ringfence::facade
