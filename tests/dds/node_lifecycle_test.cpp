// Nodes that join, leave, crash and stall during a run over loopback: the contacts are those of an undisturbed run.
#include <random>
#include <string>

#include <doctest/doctest.h>

#include "dds/node_world.hpp"
#include "geometry/gapped_ellipsoid.hpp"

namespace ringfence {
namespace {

using test::NodeWorld;

constexpr Deployment deployments[] = {Deployment::user, Deployment::user_server, Deployment::user_collision};
constexpr Placement placements[] = {Placement::server, Placement::region};

template <class Check>
void in_every_setting(Check check) {
  for (const Deployment deployment : deployments) {
    for (const Placement placement : placements) {
      INFO("deployment ", std::string(name_of(deployment)), ", placement ", std::string(name_of(placement)));
      check(deployment, placement);
    }
  }
}

/// Waits for a random part of a frame: frames of these worlds take about a millisecond.
void pass_some_time(std::mt19937_64& random) {
  const auto end = test::Clock::now() + std::chrono::microseconds(random() % 1500);
  while (test::Clock::now() < end) {
  }
}

}  // namespace

TEST_CASE("a node that is killed at any time is lost in that frame or the next, and no contact changes") {
  std::mt19937_64 random(11);
  in_every_setting([&](Deployment deployment, Placement placement) {
    NodeWorld nodes(deployment, placement, 3);
    nodes.run(5);
    nodes.run(1, [&] {
      pass_some_time(random);
      nodes.process(1).signal(SIGKILL);
    });
    CHECK(nodes.run_until([&] { return nodes.lost() == 1; }));
    nodes.run(10);
    CHECK(nodes.assigned_nodes() == 2);
    CHECK(nodes.cluster().report().lost == 1);
    const dds::MemberChange change = nodes.cluster().report().changes.back();
    CHECK(change.kind == dds::MemberChange::Kind::lost);
    CHECK(change.name == "n1");
    CHECK(change.before_ms >= 0);
    CHECK(change.after_ms > 0);
    CHECK(nodes.is_right());
  });
}

TEST_CASE("when all nodes are killed at once the server does the work, and later nodes take it over") {
  std::mt19937_64 random(12);
  in_every_setting([&](Deployment deployment, Placement placement) {
    NodeWorld nodes(deployment, placement, 2);
    nodes.run(5);
    nodes.run(1, [&] {
      pass_some_time(random);
      nodes.process(0).signal(SIGKILL);
      nodes.process(1).signal(SIGKILL);
    });
    CHECK(nodes.run_until([&] { return nodes.lost() == 2; }));
    nodes.run(5);
    CHECK(nodes.assigned_nodes() == 0);
    CHECK(nodes.world().nodes() == 1);
    nodes.start_node();
    CHECK(nodes.run_until([&] { return nodes.assigned_nodes() == 1; }));
    nodes.run(5);
    CHECK(nodes.world().nodes() == 1);
    CHECK(nodes.lost() == 2);
    CHECK(nodes.is_right());
  });
}

TEST_CASE("a node that stalls for longer than its lease is lost, and joins as a new one when it continues") {
  in_every_setting([&](Deployment deployment, Placement placement) {
    NodeWorld nodes(deployment, placement, 3);
    nodes.run(5);
    nodes.process(2).signal(SIGSTOP);
    CHECK(nodes.run_until([&] { return nodes.lost() == 1; }));
    nodes.run(5);
    CHECK(nodes.assigned_nodes() == 2);
    nodes.process(2).signal(SIGCONT);
    CHECK(nodes.run_until([&] { return nodes.assigned_nodes() == 3; }));
    nodes.run(5);
    CHECK(nodes.world().nodes() == 3);
    CHECK(nodes.is_right());
  });
}

TEST_CASE("a node that is asked to end hands everything over first, and exits with success") {
  in_every_setting([&](Deployment deployment, Placement placement) {
    NodeWorld nodes(deployment, placement, 3);
    nodes.run(5);
    nodes.process(0).signal(SIGTERM);
    CHECK(nodes.run_until([&] { return nodes.assigned_nodes() == 2; }));
    CHECK(test::wait_until([&] { return nodes.process(0).has_ended(); }));
    CHECK(nodes.process(0).exit_code() == static_cast<int>(dds::ExitReason::drained));
    nodes.run(5);
    CHECK(nodes.world().nodes() == 2);
    CHECK(nodes.lost() == 0);
    CHECK(nodes.cluster().report().left == 1);
    const dds::MemberChange change = nodes.cluster().report().changes.back();
    CHECK(change.kind == dds::MemberChange::Kind::left);
    CHECK(change.name == "n0");
    CHECK(change.before_ms > 0);
    CHECK(nodes.is_right());
  });
}

TEST_CASE("the last node that is asked to end hands everything over to the server") {
  NodeWorld nodes(Deployment::user_collision, Placement::region, 2);
  nodes.run(5);
  nodes.process(0).signal(SIGTERM);
  nodes.process(1).signal(SIGTERM);
  CHECK(nodes.run_until([&] { return nodes.assigned_nodes() == 0; }));
  for (std::size_t i = 0; i < 2; ++i) {
    CHECK(test::wait_until([&] { return nodes.process(i).has_ended(); }));
    CHECK(nodes.process(i).exit_code() == static_cast<int>(dds::ExitReason::drained));
  }
  nodes.run(5);
  CHECK(nodes.lost() == 0);
  CHECK(nodes.is_right());
}

TEST_CASE("nodes that join a running world get their share of it") {
  in_every_setting([&](Deployment deployment, Placement placement) {
    NodeWorld nodes(deployment, placement, 1);
    nodes.run(5);
    nodes.start_node();
    nodes.start_node();
    CHECK(nodes.run_until([&] { return nodes.assigned_nodes() == 3; }));
    nodes.run(5);
    CHECK(nodes.world().nodes() == 3);
    for (const NodeReport& node : nodes.world().report().nodes) {
      CHECK(node.tested > 0);
    }
    const auto changes = nodes.cluster().report().changes;
    CHECK(changes.size() == 3);
    for (const dds::MemberChange& change : changes) {
      CHECK(change.kind == dds::MemberChange::Kind::joined);
      CHECK(change.before_ms > 0);
      CHECK(change.after_ms > 0);
    }
    CHECK(nodes.is_right());
  });
}

TEST_CASE("a node without a free cell waits until another leaves") {
  NodeWorld nodes(Deployment::user_collision, Placement::region, 2, {}, 1);
  nodes.start_node();
  CHECK(test::wait_until([&] { return nodes.waiting() == 1; }));
  nodes.run(5);
  CHECK(nodes.assigned_nodes() == 2);
  nodes.process(0).signal(SIGTERM);
  CHECK(nodes.run_until([&] { return nodes.process(0).has_ended(); }));
  CHECK(nodes.run_until([&] { return nodes.assigned_nodes() == 2 && nodes.waiting() == 0; }));
  nodes.run(5);
  CHECK(nodes.lost() == 0);
  CHECK(nodes.is_right());
}

TEST_CASE("nodes join, leave and are killed at random, and no contact changes") {
  for (std::uint64_t seed = 1; seed <= 6; ++seed) {
    INFO("seed ", seed);
    std::mt19937_64 random(seed);
    NodeWorld nodes(deployments[seed / 2 % 3], placements[seed % 2], 3);
    std::vector<std::size_t> there = {0, 1, 2};
    std::size_t started = 3;
    for (int turn = 0; turn < 12; ++turn) {
      nodes.run(1 + random() % 10, [&] {
        pass_some_time(random);
        const std::size_t which = there.empty() ? 0 : random() % there.size();
        switch (there.empty() ? 0 : random() % 4) {
          case 0:
          case 1:
            nodes.start_node();
            there.push_back(started++);
            break;
          case 2:
            nodes.process(there[which]).signal(SIGKILL);
            there.erase(there.begin() + static_cast<std::ptrdiff_t>(which));
            break;
          case 3:
            nodes.process(there[which]).signal(SIGTERM);
            there.erase(there.begin() + static_cast<std::ptrdiff_t>(which));
            break;
        }
      });
    }
    CHECK(nodes.run_until([&] { return nodes.assigned_nodes() == there.size(); }));
    CHECK(nodes.is_right());
  }
}

TEST_CASE("a node on a slow machine gets less work") {
  NodeWorld nodes(Deployment::user_collision, Placement::region, 1);
  nodes.start_node(60);
  CHECK(nodes.run_until([&] { return nodes.assigned_nodes() == 2; }));
  // Balanced by measured cost, not by number of pairs.
  CHECK(nodes.run_until([&] {
    const auto& reports = nodes.world().report().nodes;
    return reports.size() == 2 && 2 * reports[1].hosted < reports[0].hosted;
  }));
  CHECK(nodes.is_right());
}

TEST_CASE(
    "a support function that throws on nodes in other processes fails the same pairs, and the World counts them") {
  WorldConfig config = NodeWorld::config_of(Deployment::user_collision, Placement::region);
  config.nodes = 0;
  World alone(std::move(config));
  test::populate(alone, NodeWorld::objects, NodeWorld::users, NodeWorld::side);
  NodeWorld nodes(Deployment::user_collision, Placement::region, 2);
  for (World* world : {&alone, &nodes.world()}) {
    ObjectSpec spec;
    spec.shape = world->add_shape(SupportShape{test::gapped_ellipsoid()});
    for (int i = 0; i < 60; ++i) {
      spec.pose.position = {3.0 + i % 10, 3.0 + i / 10, 8};
      REQUIRE(world->spawn(spec).status == Status::ok);
    }
  }
  Digest expected, found;
  std::uint64_t failed = 0;
  for (int frame = 0; frame < 20; ++frame) {
    CAPTURE(frame);
    REQUIRE(alone.advance() == Status::ok);
    REQUIRE(nodes.world().advance() == Status::ok);
    CHECK(nodes.world().report().failed_supports == alone.report().failed_supports);
    failed += alone.report().failed_supports;
    expected.add_frame(alone.contacts());
    found.add_frame(nodes.world().contacts());
  }
  CHECK(failed > 0);
  CHECK(found.value() == expected.value());
}

TEST_CASE("shapes and objects that are added while nodes join reach all of them") {
  const auto add = [](World& world, std::uint32_t i) {
    const ShapeId shape = world.add_shape(Box{{0.5f + 0.125f * static_cast<float>(i), 0.5f, 1.0f}});
    const double at = 4.0 + i;
    CHECK(world.spawn({.shape = shape, .category = Category::active, .pose = {{at, 8, 8}, {0, 0, 0, 1}}}).status ==
          Status::ok);
  };
  WorldConfig config = NodeWorld::config_of(Deployment::user_collision, Placement::region);
  config.nodes = 0;
  World alone(std::move(config));
  test::populate(alone, NodeWorld::objects, NodeWorld::users, NodeWorld::side);
  NodeWorld nodes(Deployment::user_collision, Placement::region, 1);
  Digest expected, found;
  for (std::uint32_t i = 0; i < 8; ++i) {
    add(alone, i);
    add(nodes.world(), i);
    nodes.start_node();
    for (int frame = 0; frame < 20; ++frame) {
      REQUIRE(alone.advance() == Status::ok);
      REQUIRE(nodes.world().advance() == Status::ok);
      expected.add_frame(alone.contacts());
      found.add_frame(nodes.world().contacts());
    }
  }
  CHECK(test::wait_until([&] {
    REQUIRE(alone.advance() == Status::ok);
    REQUIRE(nodes.world().advance() == Status::ok);
    expected.add_frame(alone.contacts());
    found.add_frame(nodes.world().contacts());
    return nodes.assigned_nodes() == 9;
  }));
  CHECK(found.value() == expected.value());
}

TEST_CASE("inputs of users have the same effect with nodes in other processes, also when one of them is killed") {
  WorldConfig config = NodeWorld::config_of(Deployment::user_collision, Placement::region);
  config.nodes = 0;
  World alone(std::move(config));
  test::populate(alone, NodeWorld::objects, NodeWorld::users, NodeWorld::side);
  NodeWorld nodes(Deployment::user_collision, Placement::region, 2);
  std::mt19937_64 random(12);
  Digest expected, found;
  for (int frame = 0; frame < 30; ++frame) {
    if (frame == 15) nodes.process(1).signal(SIGKILL);
    for (std::uint32_t user = 0; user < NodeWorld::users; ++user) {
      const std::byte bytes[3] = {static_cast<std::byte>(random()), static_cast<std::byte>(random())};
      for (World* world : {&alone, &nodes.world()}) {
        // populate() gives user i the avatar with number i + 1.
        REQUIRE(world->input(UserId(user), world->find(user + 1), bytes) == Status::ok);
      }
    }
    REQUIRE(alone.advance() == Status::ok);
    REQUIRE(nodes.world().advance() == Status::ok);
    expected.add_frame(alone.contacts());
    found.add_frame(nodes.world().contacts());
  }
  CHECK(found.value() == expected.value());
  CHECK_FALSE(found.value() == NodeWorld::expected(30));  // the inputs have an effect
}

}  // namespace ringfence
