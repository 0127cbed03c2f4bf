// Results that can be read after a frame, and while the next one is running.
#include <algorithm>
#include <cmath>
#include <cstring>
#include <map>
#include <set>
#include <utility>
#include <vector>

#include <doctest/doctest.h>

#include "facade/bouncing_world.hpp"
#include "facade/checks.hpp"
#include "facade/script.hpp"
#include "facade/views.hpp"
#include "ringfence/world.hpp"

namespace ringfence::test {
namespace {

constexpr double side = 12;

WorldConfig config_of(double interest) {
  WorldConfig config;
  config.bounds_max = {side, side, side};
  config.user_threads = 2;
  config.interest = interest;
  config.motion = std::make_shared<BouncingModel>(side);
  return config;
}

using Key = std::pair<ObjectNumber, ObjectNumber>;

std::map<Key, Contact> all_contacts(const World& world) {
  std::map<Key, Contact> all;
  for (const auto list : {world.contacts(), world.ended()}) {
    for (const Contact& contact : list) all[{contact.a, contact.b}] = contact;
  }
  return all;
}

bool same(const Contact& p, const Contact& q) { return std::memcmp(&p, &q, sizeof p) == 0; }

TEST_CASE("a user node receives exactly the contacts, ended ones too, of the objects that it hosts") {
  constexpr unsigned seed = 71;
  CAPTURE(seed);
  in_all_worlds(config_of(3), {0u, 2u}, [&](const WorldConfig& config) {
    World world(config);
    Script script(world, seed, side);
    std::map<ObjectNumber, ObjectSpec> specs;  // includes objects that have just ended
    for (int frame = 0; frame < 40; ++frame) {
      CAPTURE(frame);
      const std::vector<UserId> users = script.users();
      for (const ObjectView& view : world.objects()) specs[view.spec.number] = view.spec;
      advance(world);
      for (const ObjectView& view : world.objects()) specs[view.spec.number] = view.spec;
      const auto all = all_contacts(world);
      const auto avatar_of = [&](const Contact& contact, UserId user) {
        return specs.at(contact.a).user == user || specs.at(contact.b).user == user;
      };
      std::map<Key, int> receivers;
      for (const UserId user : users) {
        CAPTURE(user);
        std::size_t of_avatars = 0;
        const Contact* before = nullptr;
        for (const Contact& contact : world.collisions_of(user)) {
          const auto at = all.find({contact.a, contact.b});
          REQUIRE(at != all.end());
          REQUIRE(same(at->second, contact));
          REQUIRE((before == nullptr || Key{before->a, before->b} < at->first));
          before = &contact;
          ++receivers[at->first];
          of_avatars += avatar_of(contact, user) ? 1 : 0;
          if (config.deployment != Deployment::user) REQUIRE(avatar_of(contact, user));
        }
        REQUIRE(of_avatars == static_cast<std::size_t>(std::count_if(all.begin(), all.end(), [&](const auto& entry) {
                  return avatar_of(entry.second, user);
                })));
      }
      if (config.deployment == Deployment::user && !users.empty()) {
        // All moving objects are hosted by user nodes: each contact concerns the one or two users that host its
        // objects.
        for (const auto& [key, contact] : all) {
          const bool both_static =
              specs.at(key.first).category == Category::fixed && specs.at(key.second).category == Category::fixed;
          const auto gone = [&](ObjectNumber number) {
            const UserId user = specs.at(number).user;
            return user != no_user && !std::binary_search(users.begin(), users.end(), user);
          };
          if (both_static || gone(key.first) || gone(key.second)) continue;
          REQUIRE(receivers[key] >= 1);
          REQUIRE(receivers[key] <= 2);
        }
      }
      CHECK(world.collisions_of(UserId(60000)).empty());
      script.make_requests();
    }
  });
}

TEST_CASE("the collisions of an object are the contacts that contain it") {
  constexpr unsigned seed = 72;
  CAPTURE(seed);
  WorldConfig config = config_of(0);
  config.nodes = 2;
  World world(config);
  Script script(world, seed, side);
  for (int frame = 0; frame < 15; ++frame) {
    advance(world);
    for (const ObjectView& view : world.objects()) {
      std::vector<Contact> expected;
      for (const Contact& contact : world.contacts()) {
        if (contact.a == view.spec.number || contact.b == view.spec.number) expected.push_back(contact);
      }
      const ObjectContacts got = world.collisions_of(view.id);
      REQUIRE(got.size() == expected.size());
      for (std::size_t i = 0; i < got.size(); ++i) REQUIRE(same(got[i], expected[i]));
    }
    CHECK(world.collisions_of(ObjectId{}).empty());
    CHECK(world.collisions_of(ObjectId::of(1, 0xffffffffu)).empty());
    script.make_requests();
  }
}

TEST_CASE("a user node sees all others within its interest at their current poses, each once, and nothing of its own") {
  constexpr unsigned seed = 73;
  CAPTURE(seed);
  for (const double interest : {0.4, 3.0, 40.0}) {
    CAPTURE(interest);
    in_all_worlds(config_of(interest), {0u, 2u, 6u}, [&](const WorldConfig& config) {
      World world(config);
      Script script(world, seed, side);
      for (int frame = 0; frame < 20; ++frame) {
        CAPTURE(frame);
        const std::vector<UserId> users = script.users();
        advance(world);
        require_views(world, users);
        script.make_requests();
      }
    });
  }
}

TEST_CASE("without interest a user node reads no other states") {
  in_all_worlds(config_of(0), {0u, 1u}, [&](const WorldConfig& config) {
    World world(config);
    populate(world, 60, 3, side);
    for (int frame = 0; frame < 3; ++frame) {
      advance(world);
      for (std::uint32_t user = 0; user < 3; ++user) CHECK(world.seen_by(UserId(user)).empty());
    }
  });
}

/// A copy of everything that may be read while the next frame is running.
struct FrameResults {
  explicit FrameResults(const World& world, const std::vector<UserId>& users, const std::vector<ObjectId>& ids) {
    contacts.assign(world.contacts().begin(), world.contacts().end());
    ended.assign(world.ended().begin(), world.ended().end());
    for (const UserId user : users) {
      contacts.insert(contacts.end(), world.collisions_of(user).begin(), world.collisions_of(user).end());
      for (const auto run : world.seen_by(user)) seen.insert(seen.end(), run.begin(), run.end());
    }
    for (const ObjectId id : ids) {
      const ObjectContacts list = world.collisions_of(id);
      for (std::size_t i = 0; i < list.size(); ++i) contacts.push_back(list[i]);
    }
    report = world.report().frame;
    frames = world.frames();
  }
  bool operator==(const FrameResults& other) const {
    const auto equal = [](const auto& p, const auto& q) {
      return std::equal(p.begin(), p.end(), q.begin(), q.end(), same);
    };
    return equal(contacts, other.contacts) && equal(ended, other.ended) && seen == other.seen &&
           report == other.report && frames == other.frames;
  }
  std::vector<Contact> contacts, ended;
  std::vector<SeenState> seen;
  std::uint64_t report = 0, frames = 0;
};

TEST_CASE("while a frame is running the results of the one before can be read and do not change") {
  constexpr unsigned seed = 74;
  CAPTURE(seed);
  in_all_worlds(config_of(3), {0u, 1u, 3u, 6u}, [&](const WorldConfig& config) {
    World world(config);
    Script script(world, seed, side);
    advance(world);
    for (int frame = 0; frame < 25; ++frame) {
      CAPTURE(frame);
      std::vector<ObjectId> ids;
      for (const ObjectView& view : world.objects()) ids.push_back(view.id);
      const std::vector<UserId> users = script.users();
      const FrameResults before(world, users, ids);
      REQUIRE(world.begin_frame() == Status::ok);
      for (int again = 0; again < 3; ++again) REQUIRE((FrameResults(world, users, ids) == before));
      REQUIRE(world.finish_frame() == Status::ok);
      require_counts(world);
      REQUIRE(world.frames() == before.frames + 1);
    }
  });
}

TEST_CASE("publications of removed CD nodes can be read until the next frame is complete") {
  WorldConfig config = config_of(3);
  config.nodes = 9;
  config.deadlines.node_ms = 60;
  World world(config);
  populate(world, 300, 6, side);
  const std::vector<UserId> users = first_users(6);
  for (int frame = 0; frame < 16; ++frame) {
    CAPTURE(frame);
    if (frame == 3) REQUIRE(world.resize(7) == Status::ok);
    if (frame == 6) REQUIRE(world.inject({NodeId(2), world.frames(), NodeStage::reporting, 0}) == Status::ok);
    if (frame == 9)
      REQUIRE(world.inject({NodeId(0), world.frames(), NodeStage::moving, 150}) ==
              Status::ok);  // its thread ends later
    if (frame == 13) REQUIRE(world.resize(1) == Status::ok);
    REQUIRE(world.advance() == Status::ok);
    require_views(world, users);
    const FrameResults before(world, users, {});
    CHECK(before.seen.size() > 100);
    REQUIRE(world.begin_frame() == Status::ok);
    REQUIRE((FrameResults(world, users, {}) == before));
    REQUIRE(world.finish_frame() == Status::ok);
    require_views(world, users);
  }
  CHECK(world.nodes() == 1);
}

TEST_CASE("requests made while a frame is running belong to the next frame") {
  in_all_worlds({}, {0u, 2u}, [&](const WorldConfig& config) {
    World world(config);
    const ShapeId ball = world.add_shape(Sphere{1});
    const UserId user = world.connect().user;
    const ObjectId avatar = world.spawn({.shape = ball, .category = Category::avatar, .user = user}).id;
    const ObjectId old = world.spawn({.shape = ball, .pose = {{50, 0, 0}, {}}}).id;
    advance(world);
    REQUIRE(world.begin_frame() == Status::ok);
    const Spawned late = world.spawn({.shape = ball, .pose = {{50, 1, 0}, {}}});
    CHECK(late.status == Status::ok);
    CHECK(world.move(user, avatar, {{10, 0, 0}, {}}) == Status::ok);
    CHECK(world.place(late.id, {{50, 1.5, 0}, {}}) == Status::ok);
    const Connected second = world.connect();
    CHECK(second.status == Status::ok);
    CHECK(world.spawn({.shape = ball, .category = Category::avatar, .user = second.user}).status == Status::ok);
    REQUIRE(world.finish_frame() == Status::ok);
    CHECK(world.report().objects == 2);
    CHECK(world.contacts().empty());
    CHECK(world.object(avatar).spec.pose.position.x == 0);
    CHECK_FALSE(world.object(late.id).id);
    advance(world);
    CHECK(world.report().objects == 4);
    CHECK(world.object(avatar).spec.pose.position.x == 10);
    REQUIRE(world.contacts().size() == 1);
    CHECK(world.contacts()[0].a == old.number());
    CHECK(world.contacts()[0].phase == Phase::begin);
  });
}

TEST_CASE("the last move before a frame counts, a later remove cancels it, and the model continues from there") {
  in_all_worlds(config_of(0), {0u, 2u}, [&](WorldConfig config) {
    config.motion = nullptr;
    World world(config);
    const ShapeId ball = world.add_shape(Sphere{1});
    const UserId user = world.connect().user;
    const ObjectId avatar = world.spawn({.shape = ball, .category = Category::avatar, .user = user}).id;
    for (const double x : {1.0, 2.0, 3.0}) CHECK(world.move(user, avatar, {{x, 0, 0}, {}}) == Status::ok);
    advance(world);
    CHECK(world.object(avatar).spec.pose.position.x == 3);
    CHECK(world.move(user, avatar, {{4, 0, 0}, {}}) == Status::ok);
    CHECK(world.set_enabled(avatar, false) == Status::ok);
    advance(world);
    CHECK_FALSE(world.object(avatar).spec.enabled);
    CHECK(world.set_enabled(avatar, false) == Status::ok);
    CHECK(world.move(user, avatar, {{5, 0, 0}, {}}) == Status::ok);
    advance(world);
    CHECK(world.object(avatar).spec.enabled);
    CHECK(world.object(avatar).spec.pose.position.x == 5);
    // A quaternion within 10^-3 of unit length is normalised.
    CHECK(world.move(user, avatar, {{5, 0, 0}, {0, 0, 0, 1.0005f}}) == Status::ok);
    advance(world);
    CHECK(world.object(avatar).spec.pose.orientation == Quat{});
  });
}

TEST_CASE("a world can be destroyed while a frame is running") {
  in_all_worlds(config_of(3), {0u, 1u, 4u}, [&](const WorldConfig& config) {
    for (const int frames : {0, 3}) {
      World world(config);
      Script script(world, 75, side);
      for (int frame = 0; frame < frames; ++frame) {
        advance(world);
        script.make_requests();
      }
      REQUIRE(world.begin_frame() == Status::ok);
    }
    World unused(config);  // and a world without any frame
  });
}

}  // namespace
}  // namespace ringfence::test
