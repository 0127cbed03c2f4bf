// Everything at once, in random order: roles step in random order over small rings; CD nodes are lost at random
// moments, several in a frame, and some of them continue to run; nodes join and leave; objects are spawned, destroyed
// and placed; users connect and disconnect. The contacts must be those of one node without any loss, and so must the
// answers to queries in frames without a loss.
#include <cstdint>
#include <cstdlib>
#include <cstring>
#include <limits>
#include <optional>
#include <random>
#include <set>
#include <string>
#include <vector>

#include <doctest/doctest.h>

#include "nodes/test_harness.hpp"
#include "nodes/wandering_model.hpp"

namespace ringfence::nodes::test {
namespace {

/// Some objects disappear now and then.
class VanishingModel : public WanderingModel {
 public:
  using WanderingModel::WanderingModel;
  void move(std::uint64_t frame, std::span<const MotionInput> inputs, std::span<MotionOutput> outputs) const override {
    WanderingModel::move(frame, inputs, outputs);
    for (std::size_t i = 0; i < inputs.size(); ++i) {
      if (inputs[i].number % 7 == 3 && inputs[i].category != Category::avatar) {
        outputs[i].enabled = (frame + inputs[i].number) % 5 > 1;
      }
    }
  }
};
const VanishingModel wandering(248);  // a hand-over of a dozen objects fills a ring

/// The same random requests for two harnesses, from one seed.
class Script {
 public:
  Script(TestHarness& harness, std::uint64_t seed) : harness_(harness), random_(seed) {
    shapes_[0] = harness.add_shape(Sphere{6});
    // The origin is outside its bounds, so it need not touch its host's region.
    shapes_[1] = harness.add_shape(ConvexHull{{{5, 1, 1}, {15, 1, 1}, {5, 9, 1}, {5, 1, 9}, {12, 7, 8}}});
    for (UserNumber user = 0; user < 2; ++user) {
      connect(user);
    }
    for (int i = 0; i < 60; ++i) {
      spawn(i % 13 == 12 ? Category::fixed : i % 3 == 0 ? Category::non_active : Category::active, no_user);
    }
  }

  void make_requests() {
    for (std::uint64_t n = random_() % 4; n > 0; --n) {
      spawn(Category::active, no_user);
    }
    for (std::uint64_t n = random_() % 4; n > 0 && objects_.size() > 50; --n) {
      const std::size_t at = random_() % objects_.size();
      harness_.destroy(objects_[at]);
      objects_[at] = objects_.back();
      objects_.pop_back();
    }
    for (std::uint64_t n = random_() % 4; n > 0; --n) {
      harness_.place(objects_[random_() % objects_.size()], anywhere());
    }
    if (random_() % 8 == 0) {
      const auto user = static_cast<UserNumber>(random_() % 3);
      if (connected_[user]) {
        harness_.disconnect(user);
        connected_[user] = false;
      } else {
        connect(user);
      }
    }
  }
  void clear_requested() { requested_.clear(); }

 private:
  Pose anywhere() {
    const auto coordinate = [&] { return static_cast<double>(random_() % 600) / 10; };
    return {{coordinate(), coordinate(), coordinate()}, {}};
  }
  void connect(UserNumber user) {
    harness_.connect(user);
    connected_[user] = true;
    spawn(Category::avatar, UserId(user));
  }
  void spawn(Category category, UserId user) {
    ObjectSpec spec;
    spec.shape = shapes_[random_() % 4 == 0 ? 1 : 0];
    spec.category = category;
    spec.user = user;
    spec.pose = anywhere();
    // Numbers far apart and reused numbers, beside consecutive ones.
    if (random_() % 4 == 0) {
      const auto number = static_cast<ObjectNumber>(10'000 + random_() % 3000);
      const bool is_free = harness_.table().find(number) == base::NumberIndex::none && requested_.insert(number).second;
      spec.number = is_free ? number : 0;
    }
    const ObjectId id = harness_.spawn(spec);
    if (category != Category::fixed && category != Category::avatar) {
      objects_.push_back(id);
    }
  }

  TestHarness& harness_;
  std::mt19937_64 random_;
  ShapeId shapes_[2] = {};
  std::vector<ObjectId> objects_;  ///< that can move, except avatars
  bool connected_[3] = {};
  std::set<ObjectNumber> requested_;  ///< numbers that have been requested but may not be in the table yet
};

/// Queries of all kinds, some of which reach the whole world.
std::vector<messages::QueryRecord> random_queries(std::mt19937_64& random, std::size_t count) {
  std::vector<messages::QueryRecord> queries(random() % count + 1);
  const auto vector = [&](double size) {
    const auto uniform = [&] { return size * static_cast<double>(random() % 2001) / 2000; };
    return Vec3d{uniform(), uniform(), uniform()};
  };
  for (messages::QueryRecord& query : queries) {
    query.kind = static_cast<std::uint32_t>(random() % messages::query_kinds);
    query.start.position = vector(60);
    const Vec3d half = vector(random() % 2 == 0 ? 20 : 120);
    const double reach = random() % 2 == 0 ? 10 : 60;
    query.displacement = {half.x - reach, half.y - reach, half.z - reach};
    query.distance = random() % 3 == 0 ? std::numeric_limits<double>::infinity() : 5;
    query.shape = static_cast<ShapeNumber>(random() % 2);
    query.layers = ~0u;
    query.categories = random() % 3 == 0 ? static_cast<std::uint32_t>(random() % 16) : ~0u;
    query.except_number = static_cast<ObjectNumber>(random() % 60);
    query.except_generation = query.except_number;
  }
  return queries;
}

struct RunResult {
  std::size_t lost = 0, resized = 0, hits = 0;
  std::uint64_t unlisted = 0;
};

RunResult run_schedule(std::uint64_t seed, int frames) {
  std::mt19937_64 random(seed);
  const auto one_in = [&](std::uint64_t n) { return random() % n == 0; };
  HarnessConfig plain_config;
  plain_config.deployment = std::array{Deployment::user, Deployment::user_server, Deployment::user_collision,
                                       Deployment::user_collision, Deployment::user_collision}[random() % 5];
  plain_config.model = &wandering;
  plain_config.grid = {{2, 2, 2}};
  plain_config.nodes = 1;
  plain_config.delivery_bytes = std::size_t{1} << 17;
  plain_config.deepest_contacts = one_in(3) ? 0 : 1 + static_cast<std::uint32_t>(random() % 2);
  HarnessConfig random_config = plain_config;
  random_config.placement = one_in(3) ? Placement::server : Placement::region;
  random_config.nodes = 1 + static_cast<std::uint32_t>(random() % 5);
  random_config.shares_memory = !one_in(3);
  random_config.nodes_may_be_lost = !one_in(4);
  random_config.interest = one_in(2) ? 12 : 0;
  const std::string run_name = std::string(name_of(random_config.deployment)) + ", " +
                               name_of(random_config.placement) +
                               (random_config.shares_memory ? ", memory shared" : ", messages only") +
                               (random_config.nodes_may_be_lost ? "" : ", no losses");
  CAPTURE(run_name);
  TestHarness expected(plain_config), harness(random_config);
  Script expected_script(expected, seed), script(harness, seed);
  const std::uint64_t loss_period = 1 + random() % 8;
  const std::uint64_t resize_period = 1 + random() % 12;
  RunResult result;
  for (int frame = 0; frame < frames; ++frame) {
    CAPTURE(frame);
    expected_script.make_requests();
    script.make_requests();
    const bool asks = random() % 4 != 0;
    const auto queries = asks ? random_queries(random, 30) : std::vector<messages::QueryRecord>();
    expected.ask(queries);
    harness.ask(queries);
    expected.frame();
    if (one_in(resize_period)) {
      harness.resize(1 + static_cast<std::uint32_t>(random() % 6));
      ++result.resized;
    }
    const std::size_t losses = random_config.nodes_may_be_lost && one_in(loss_period) ? 1 + random() % 4 : 0;
    harness.frame(RandomOrder{&random, losses, one_in(2)});
    expected_script.clear_requested();
    script.clear_requested();
    const FrameReport& report = harness.report();
    const auto contacts = harness.contacts(), others = expected.contacts();
    REQUIRE(contacts.size() == others.size());
    REQUIRE(std::memcmp(contacts.data(), others.data(), contacts.size_bytes()) == 0);
    const auto ended = harness.ended(), others_ended = expected.ended();
    REQUIRE(ended.size() == others_ended.size());
    REQUIRE(std::memcmp(ended.data(), others_ended.data(), ended.size_bytes()) == 0);
    REQUIRE(report.unlisted == expected.report().unlisted);
    REQUIRE(report.accepted == report.candidates);
    REQUIRE(report.tested + report.carried == report.candidates);
    for (std::size_t reason = 0; reason < status_count; ++reason) {
      CAPTURE(name_of(static_cast<Status>(reason)));
      REQUIRE((reason == static_cast<std::size_t>(Status::late) || report.refused[reason] == 0));
    }
    if (report.lost.empty()) {
      harness.require_one_host_each();
      REQUIRE(expected.answers().has_value() == asks);
      REQUIRE((harness.answers() == expected.answers()));
      result.hits += asks ? harness.answers()->size() : 0;
    } else {
      REQUIRE(!harness.answers());
    }
    if (random_config.interest > 0) {
      harness.require_views();
    }
    result.lost += report.lost.size();
    result.unlisted += report.unlisted;
  }
  return result;
}

TEST_CASE(
    "with roles stepped in random order, losses at any moment, joins and leaves, the contacts are those of one node") {
  const char* const requested = std::getenv("RINGFENCE_SCHEDULES");
  const std::uint64_t schedules = requested != nullptr ? std::strtoull(requested, nullptr, 10) : 60;
  const char* const from = std::getenv("RINGFENCE_FIRST_SCHEDULE");
  const std::uint64_t first = from != nullptr ? std::strtoull(from, nullptr, 10) : 1;
  RunResult all;
  for (std::uint64_t seed = first; seed < first + schedules; ++seed) {
    CAPTURE(seed);
    const RunResult result = run_schedule(seed, 20);
    all.lost += result.lost;
    all.resized += result.resized;
    all.hits += result.hits;
    all.unlisted += result.unlisted;
  }
  CHECK(all.lost > 4 * schedules);
  CHECK(all.resized > 2 * schedules);
  CHECK(all.hits > 100 * schedules);
  CHECK(all.unlisted > 50 * schedules);
}

}  // namespace
}  // namespace ringfence::nodes::test
