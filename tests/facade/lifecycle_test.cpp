// Whole runs with random requests of every kind, in every deployment.
#include <cstring>
#include <iterator>
#include <map>
#include <memory>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include <doctest/doctest.h>

#include "facade/bouncing_world.hpp"
#include "facade/checks.hpp"
#include "facade/script.hpp"
#include "ringfence/world.hpp"

namespace ringfence::test {
namespace {

constexpr double side = 7;

WorldConfig config_of() {
  WorldConfig config;
  config.bounds_max = {side, side, side};
  config.user_threads = 3;
  config.interest = 3;
  config.motion = std::make_shared<BouncingModel>(side);
  return config;
}

struct LifecycleRun {
  std::uint64_t digest = 0;
  std::vector<std::uint64_t> fingerprints;
  std::uint64_t contacts = 0, candidates = 0, ended = 0;
};

LifecycleRun live(const WorldConfig& config, unsigned seed, int frames, Caller caller = Caller::usual) {
  const auto made = call_from(caller, [&] { return std::make_unique<World>(config); });
  World& world = *made;
  Script script(world, seed, side, caller);
  Digest digest;
  LifecycleRun life;
  for (int frame = 0; frame < frames; ++frame) {
    CAPTURE(frame);
    call_from(caller, [&] { advance(world); });
    REQUIRE(world.report().objects == world.objects().size());
    REQUIRE(world.report().objects == script.live());
    digest.add_frame(world.contacts());
    life.fingerprints.push_back(fingerprint(world));
    life.contacts += world.contacts().size();
    life.ended += world.ended().size();
    life.candidates += world.report().candidates;
    script.make_requests();
  }
  life.digest = digest.value();
  return life;
}

TEST_CASE("random spawns, ends, moves, removals and users give the same states and contacts in every deployment") {
  for (const unsigned seed : {1u, 2u, 3u}) {
    CAPTURE(seed);
    WorldConfig config = config_of();
    config.nodes = 0;
    const LifecycleRun expected = live(config, seed, 60);
    REQUIRE(expected.contacts > 800);
    REQUIRE(expected.ended > 200);
    std::size_t worlds = seed;
    in_all_worlds(config_of(), {0u, 1u, 3u}, [&](const WorldConfig& other) {
      const Caller caller = callers[worlds++ % std::size(callers)];
      CAPTURE(std::string(name_of(caller)));
      const LifecycleRun got = live(other, seed, 60, caller);
      CHECK(got.digest == expected.digest);
      CHECK(got.candidates == expected.candidates);
      for (std::size_t frame = 0; frame < expected.fingerprints.size(); ++frame) {
        CAPTURE(frame);
        REQUIRE(got.fingerprints[frame] == expected.fingerprints[frame]);
      }
    });
  }
}

TEST_CASE("the smallest rings give the same results") {
  constexpr unsigned seed = 4;
  CAPTURE(seed);
  WorldConfig config = config_of();
  config.nodes = 0;
  const LifecycleRun expected = live(config, seed, 30);
  config.tuning.ring_bytes = 4096;
  in_all_worlds(config, {0u, 2u, 5u},
                [&](const WorldConfig& other) { CHECK(live(other, seed, 30).digest == expected.digest); });
}

TEST_CASE("any number of user threads and up to 16 nodes give the same results") {
  constexpr unsigned seed = 5;
  CAPTURE(seed);
  WorldConfig config = config_of();
  config.nodes = 0;
  const LifecycleRun expected = live(config, seed, 25);
  for (const std::uint32_t threads : {1u, 2u, 3u, 4u}) {
    for (const Deployment deployment : {Deployment::user, Deployment::user_collision}) {
      config.nodes = threads == 4 ? 16 : 2 * threads - 1;
      config.user_threads = threads;
      config.deployment = deployment;
      config.placement = threads % 2 == 0 ? Placement::region : Placement::server;
      CAPTURE(describe(config));
      CAPTURE(threads);
      CHECK(live(config, seed, 25).digest == expected.digest);
    }
  }
}

TEST_CASE("outgrown buffers change only a counter and log one warning") {
  constexpr unsigned seed = 6;
  CAPTURE(seed);
  WorldConfig config = config_of();
  config.nodes = 0;
  const LifecycleRun expected = live(config, seed, 25);
  config.capacities = {1, 1, 1, 1};
  in_all_worlds(config, {0u, 3u}, [&](WorldConfig other) {
    std::vector<std::string> warnings;
    other.log = [&](LogLevel level, std::string_view line) {
      CHECK(level == LogLevel::warning);
      CHECK(line.find('\n') == std::string_view::npos);
      warnings.emplace_back(line);
    };
    CHECK(live(other, seed, 25).digest == expected.digest);
    CHECK(warnings.size() == 1);
    if (!warnings.empty()) {
      CHECK(warnings[0].find("WorldConfig::capacities") != std::string::npos);
    }
  });
}

using Key = std::pair<ObjectNumber, ObjectNumber>;

TEST_CASE("phases follow from the contacts of two frames, and every way to leave the world ends an object's contacts") {
  constexpr unsigned seed = 7;
  CAPTURE(seed);
  in_all_worlds(config_of(), {0u, 2u}, [&](const WorldConfig& config) {
    World world(config);
    Script script(world, seed, side);
    std::map<Key, Contact> before;
    for (int frame = 0; frame < 50; ++frame) {
      CAPTURE(frame);
      advance(world);
      std::map<Key, Contact> now;
      std::set<ObjectNumber> present;
      for (const ObjectView& view : world.objects()) {
        if (view.spec.enabled) present.insert(view.spec.number);
      }
      for (const Contact& contact : world.contacts()) {
        now[{contact.a, contact.b}] = contact;
        REQUIRE((contact.phase == Phase::persist) == (before.count({contact.a, contact.b}) != 0));
        REQUIRE(present.count(contact.a) == 1);
        REQUIRE(present.count(contact.b) == 1);
      }
      std::map<Key, Contact> ended;
      for (const Contact& contact : world.ended()) {
        REQUIRE(contact.phase == Phase::end);
        REQUIRE(ended.emplace(Key{contact.a, contact.b}, contact).second);
      }
      for (auto& [key, contact] : before) {
        REQUIRE((ended.count(key) != 0) == (now.count(key) == 0));
        if (ended.count(key) != 0) {
          // Geometry and poses are those of the last contact.
          contact.phase = Phase::end;
          REQUIRE(std::memcmp(&ended[key], &contact, sizeof contact) == 0);
          ended.erase(key);
        }
      }
      REQUIRE(ended.empty());
      before = now;
      script.make_requests();
    }
  });
}

TEST_CASE("destroyed, removed and disconnected objects end their contacts in the next frame, and only theirs") {
  in_all_worlds({}, {0u, 2u}, [&](WorldConfig config) {
    config.interest = 0;
    World world(config);
    const ShapeId ball = world.add_shape(Sphere{1});
    const UserId user = world.connect().user;
    // Three pairs apart from each other; one object of each pair disappears, the other stays.
    std::vector<ObjectId> first, second;
    for (int i = 0; i < 4; ++i) {
      ObjectSpec spec{
          .shape = ball, .category = i == 2 ? Category::avatar : Category::active, .user = i == 2 ? user : no_user};
      spec.pose.position = {10.0 * i + 5, 50, 50};
      first.push_back(world.spawn(spec).id);
      spec.category = Category::non_active;
      spec.user = no_user;
      spec.pose.position.y += 1;
      second.push_back(world.spawn(spec).id);
    }
    advance(world);
    REQUIRE(world.contacts().size() == 4);
    CHECK(world.destroy(first[0]) == Status::ok);
    CHECK(world.set_enabled(first[1], false) == Status::ok);
    CHECK(world.disconnect(user) == Status::ok);
    advance(world);
    REQUIRE(world.contacts().size() == 1);
    CHECK(world.contacts()[0].a == first[3].number());
    REQUIRE(world.ended().size() == 3);
    for (std::size_t i = 0; i < 3; ++i) {
      CHECK(world.ended()[i].a == first[i].number());
      CHECK(world.ended()[i].b == second[i].number());
    }
    CHECK_FALSE(world.object(first[0]).id);
    CHECK(world.object(first[1]).id);
    CHECK_FALSE(world.object(first[1]).spec.enabled);
    CHECK_FALSE(world.object(first[2]).id);
    advance(world);
    CHECK(world.ended().empty());
    CHECK(world.place(first[1], {{15, 50, 50}, {}}) == Status::ok);
    advance(world);
    CHECK(world.contacts().size() == 2);
  });
}

}  // namespace
}  // namespace ringfence::test
