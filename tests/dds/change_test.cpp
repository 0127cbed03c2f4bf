// Changes of objects and shapes, and failures of the motion model, with nodes in other processes.
#include <algorithm>
#include <cstdint>
#include <cstring>
#include <memory>
#include <vector>

#include <doctest/doctest.h>

#include "dds/node_world.hpp"

namespace ringfence {
namespace {

using test::NodeWorld;

/// Changes some objects; the calls depend on the frame alone.
void change(World& world, std::uint64_t frame) {
  for (ObjectNumber number = 1 + static_cast<ObjectNumber>(frame % 7); number <= NodeWorld::objects; number += 7) {
    const ObjectId id = world.find(number);
    const std::uint64_t draw = number * 31 + frame;
    if (draw % 3 == 0) REQUIRE(world.set_group(id, static_cast<std::uint32_t>(draw % 4)) == Status::ok);
    if (draw % 3 == 1) REQUIRE(world.set_shape(id, ShapeId(static_cast<std::uint32_t>(draw % 2))) == Status::ok);
    const std::span<const std::byte> state = world.state(id);
    if (draw % 3 == 2 && world.object(id).spec.category != Category::fixed) {
      std::vector<std::byte> turned(state.begin(), state.end());
      std::rotate(turned.begin(), turned.begin() + 8, turned.begin() + 24);
      REQUIRE(world.set_state(id, turned) == Status::ok);
    }
  }
}

/// Whether two worlds have the same contacts and objects.
void require_same(const World& p, const World& q) {
  const auto a = p.contacts(), b = q.contacts();
  REQUIRE(a.size() == b.size());
  REQUIRE((a.empty() || std::memcmp(a.data(), b.data(), a.size_bytes()) == 0));
  for (const ObjectView& view : p.objects()) {
    const ObjectView other = q.object(view.id);
    REQUIRE(other.spec.pose == view.spec.pose);
    REQUIRE(other.spec.shape == view.spec.shape);
    REQUIRE(other.spec.group == view.spec.group);
    const auto state = p.state(view.id), others = q.state(view.id);
    REQUIRE(std::equal(state.begin(), state.end(), others.begin(), others.end()));
  }
}

TEST_CASE(
    "changed objects and removed shapes are the same at nodes in other processes, also at those that join later") {
  for (const Deployment deployment : {Deployment::user, Deployment::user_server, Deployment::user_collision}) {
    for (const Placement placement : {Placement::server, Placement::region}) {
      CAPTURE(name_of(deployment));
      CAPTURE(name_of(placement));
      NodeWorld remote(deployment, placement, 2);
      WorldConfig config = NodeWorld::config_of(deployment, placement);
      config.nodes = 0;
      World local(std::move(config));
      test::populate(local, NodeWorld::objects, NodeWorld::users, NodeWorld::side);
      std::uint64_t contacts = 0;
      const auto in_both = [&](auto call) {
        call(remote.world());
        call(local);
      };
      const auto advance = [&] {
        in_both([](World& world) { REQUIRE(world.advance() == Status::ok); });
        require_same(remote.world(), local);
        contacts += local.report().contacts;
      };
      const ShapeId capsule(2), hull(3);
      in_both([&](World& world) {
        std::vector<Vec3f> points;
        for (int i = 0; i < 64; ++i)
          points.push_back({0.01f * static_cast<float>(i * i % 97), 0.01f * static_cast<float>(i),
                            0.01f * static_cast<float>(i * 7 % 64)});
        REQUIRE(world.add_shape(ConvexHull{points}) == hull);
      });
      for (std::uint64_t frame = 0; frame < 8; ++frame) {
        advance();
        in_both([&](World& world) { change(world, frame); });
      }
      in_both([&](World& world) {
        CHECK(world.remove_shape(capsule) == Status::shape_in_use);
        for (const ObjectView& view : world.objects()) {
          if (view.spec.shape == capsule) REQUIRE(world.set_shape(view.id, hull) == Status::ok);
        }
      });
      advance();
      in_both([&](World& world) {
        REQUIRE(world.remove_shape(capsule) == Status::ok);
        REQUIRE(world.add_shape(Sphere{0.4f}) == ShapeId(4));
        for (const ObjectView& view : world.objects()) {
          if (view.spec.shape == hull) REQUIRE(world.set_shape(view.id, ShapeId(4)) == Status::ok);
        }
      });
      advance();
      in_both([&](World& world) { REQUIRE(world.remove_shape(hull) == Status::ok); });
      remote.start_node();
      CHECK(test::wait_until([&] {
        advance();
        return remote.assigned_nodes() == 3;
      }));
      for (std::uint64_t frame = 0; frame < 6; ++frame) {
        in_both([&](World& world) { change(world, frame); });
        advance();
      }
      CHECK(contacts > 300);
      CHECK(remote.world().report().lost.empty());
    }
  }
}

TEST_CASE("what the model throws at nodes in other processes is reported as for nodes in this one") {
  NodeWorld remote(Deployment::user_collision, Placement::region, 2, {}, 0, NodeWorld::Model::throwing);
  WorldConfig config = NodeWorld::config_of(Deployment::user_collision, Placement::region);
  config.motion = std::make_shared<test::ThrowingModel>(NodeWorld::side);
  config.nodes = 2;
  World local(std::move(config));
  test::populate(local, NodeWorld::objects, NodeWorld::users, NodeWorld::side);
  for (std::uint64_t frame = 0; frame < 12; ++frame) {
    CAPTURE(frame);
    REQUIRE(remote.world().advance() == Status::ok);
    REQUIRE(local.advance() == Status::ok);
    require_same(remote.world(), local);
    const auto& found = remote.world().report().model_failures;
    const auto& expected = local.report().model_failures;
    REQUIRE(found.size() == expected.size());
    CHECK(found.size() == max_model_failures);
    for (std::size_t i = 0; i < found.size(); ++i) {
      CHECK(found[i].object == expected[i].object);
      CHECK(found[i].text == expected[i].text);
      CHECK(found[i].text == "no move for " + std::to_string(found[i].object.number()));
    }
  }
}

}  // namespace
}  // namespace ringfence
