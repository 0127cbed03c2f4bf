// Which pairs of objects are never tested: two static objects, and objects of one group.
#include <cstdint>
#include <set>
#include <utility>
#include <vector>

#include <doctest/doctest.h>

#include "facade/bouncing_world.hpp"
#include "facade/checks.hpp"
#include "ringfence/world.hpp"

namespace ringfence::test {
namespace {

TEST_CASE("a floor of static tiles has no candidates, and a ball on it touches the tiles below") {
  WorldConfig base;
  base.bounds_max = {20, 20, 20};
  in_all_worlds(base, {0u, 1u, 5u}, [](const WorldConfig& config) {
    World world(config);
    const ShapeId tile = world.add_shape(Box{{0.5f, 0.5f, 0.5f}}), ball = world.add_shape(Sphere{0.25f});
    for (int x = 0; x < 20; ++x) {
      for (int y = 0; y < 20; ++y) {
        REQUIRE(
            world.spawn({.shape = tile, .category = Category::fixed, .pose = {{x + 0.5, y + 0.5, 0.5}, {}}}).status ==
            Status::ok);
      }
    }
    advance(world);
    CHECK(world.report().candidates == 0);
    CHECK(world.contacts().empty());
    const ObjectId id = world.spawn({.shape = ball, .pose = {{10, 10, 1.125}, {}}}).id;
    for (int frame = 0; frame < 6; ++frame) {
      advance(world);
      CHECK(world.report().candidates == 4);
      REQUIRE(world.contacts().size() == 4);
      for (const Contact& contact : world.contacts()) CHECK(contact.b == id.number());
    }
    REQUIRE(world.place(id, {{5.5, 5.5, 1.125}, {}}) == Status::ok);
    advance(world);
    CHECK(world.contacts().size() == 1);
  });
}

TEST_CASE("objects of one group are not in contact with each other, but with all others, whoever hosts them") {
  WorldConfig base;
  base.bounds_max = {16, 16, 16};
  in_all_worlds(base, {0u, 1u, 7u}, [](const WorldConfig& config) {
    World world(config);
    const ShapeId ball = world.add_shape(Sphere{1});
    const UserId user = world.connect().user;
    const std::uint32_t groups[] = {0, 7, 4'000'000'000};
    std::vector<ObjectSpec> specs;
    for (int i = 0; i < 36; ++i) {
      ObjectSpec spec;
      spec.number = static_cast<ObjectNumber>(i + 1);
      spec.shape = ball;
      spec.group = groups[i % 3];
      spec.category = i % 4 == 0   ? Category::fixed
                      : i % 4 == 1 ? Category::avatar
                      : i % 4 == 2 ? Category::active
                                   : Category::non_active;
      spec.user = spec.category == Category::avatar ? user : no_user;
      spec.pose.position = {8, 8, 8};
      specs.push_back(spec);
      REQUIRE(world.spawn(spec).status == Status::ok);
    }
    std::set<std::pair<ObjectNumber, ObjectNumber>> expected;
    for (const ObjectSpec& p : specs) {
      for (const ObjectSpec& q : specs) {
        const bool both_static = p.category == Category::fixed && q.category == Category::fixed;
        const bool one_group = p.group != 0 && p.group == q.group;
        if (p.number < q.number && !both_static && !one_group) expected.emplace(p.number, q.number);
      }
    }
    for (int frame = 0; frame < 4; ++frame) {
      advance(world);
      CHECK(world.report().candidates == expected.size());
      std::set<std::pair<ObjectNumber, ObjectNumber>> found;
      for (const Contact& contact : world.contacts()) found.emplace(contact.a, contact.b);
      CHECK(found == expected);
      // Another region, so that hosts and the nodes that know the objects change.
      const double x = frame % 2 == 0 ? 2 : 8;
      expected.clear();
      for (const ObjectSpec& p : specs) {
        if (p.category == Category::fixed) continue;
        REQUIRE(world.place(world.find(p.number), {{x, 8, 8}, {}}) == Status::ok);
      }
      for (const ObjectSpec& p : specs) {
        for (const ObjectSpec& q : specs) {
          const bool fixed_p = p.category == Category::fixed, fixed_q = q.category == Category::fixed;
          const bool one_group = p.group != 0 && p.group == q.group;
          if (p.number >= q.number || (fixed_p && fixed_q) || one_group) continue;
          if (fixed_p == fixed_q || x == 8) expected.emplace(p.number, q.number);
        }
      }
    }
    for (const ObjectView& view : world.objects()) CHECK(view.spec.group == specs[view.spec.number - 1].group);
  });
}

}  // namespace
}  // namespace ringfence::test
