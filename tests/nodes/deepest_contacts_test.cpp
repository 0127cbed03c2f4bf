// The limit of the list of contacts, compared with a world without it that moves the same way.
#include <algorithm>
#include <cstring>
#include <map>
#include <random>
#include <string>
#include <tuple>
#include <utility>
#include <vector>

#include <doctest/doctest.h>

#include "nodes/drifting_model.hpp"
#include "nodes/test_harness.hpp"

namespace ringfence::nodes::test {
namespace {

const DriftingModel drifting;  // does not read contacts

using Pair = std::pair<ObjectNumber, ObjectNumber>;

/// Which node found a contact, and whether it is listed.
struct Finding {
  NodeNumber by;
  bool listed;
};

/// The same objects and requests in two harnesses: one without a limit, and one that lists the deepest two of each
/// object.
class Run {
 public:
  static constexpr std::size_t limit = 2;

  Run(HarnessConfig config, unsigned seed) : all_(config), limited_(with_limit(config)), random_(seed) {
    for (const float radius : {4.0f, 6.0f, 8.0f}) {
      shapes_.push_back(all_.add_shape(Sphere{radius}));
      limited_.add_shape(Sphere{radius});
    }
    for (int i = 0; i < 96; ++i) spawn(i % 12 == 7 ? Category::fixed : Category::active);
  }

  void frame() {
    if (random_() % 3 == 0) {
      const std::size_t at = random_() % objects_.size();
      for (TestHarness* harness : {&all_, &limited_}) harness->destroy(objects_[at]);
      objects_.erase(objects_.begin() + static_cast<std::ptrdiff_t>(at));
      spawn(Category::active);
    }
    if (changes_nodes && random_() % 4 == 0) {
      limited_.resize(1 + static_cast<std::uint32_t>(random_() % 5));
    } else if (changes_nodes && random_() % 5 == 0) {
      limited_.kill(static_cast<NodeNumber>(random_() % limited_.nodes()), random_() % 40);
    }
    all_.frame();
    limited_.frame();
    check();
  }

  bool changes_nodes = false;
  std::size_t unlisted = 0;
  std::size_t left_out_while_passed = 0;  ///< contacts that left the list when another node found them than before

 private:
  static HarnessConfig with_limit(HarnessConfig config) {
    config.deepest_contacts = limit;
    return config;
  }
  void spawn(Category category) {
    ObjectSpec spec;
    spec.shape = shapes_[random_() % shapes_.size()];
    spec.category = category;
    const auto coordinate = [&] { return static_cast<double>(random_() % 260) / 10 + 19; };  // around all borders
    spec.pose.position = {coordinate(), coordinate(), coordinate()};
    const ObjectId id = all_.spawn(spec);
    REQUIRE(limited_.spawn(spec) == id);
    if (category != Category::fixed) objects_.push_back(id);
  }

  // By definition: each object ranks all its contacts.
  std::map<Pair, Contact> expected() const {
    std::map<ObjectNumber, std::vector<std::tuple<float, Pair>>> ranks;
    std::map<Pair, Contact> contacts, listed;
    for (const Contact& contact : all_.contacts()) {
      const Pair pair(contact.a, contact.b);
      contacts[pair] = contact;
      ranks[contact.a].emplace_back(-contact.depth, pair);
      ranks[contact.b].emplace_back(-contact.depth, pair);
    }
    for (auto& [number, ranked] : ranks) {
      std::sort(ranked.begin(), ranked.end());
      for (std::size_t i = 0; i < std::min(limit, ranked.size()); ++i) {
        const Pair pair = std::get<1>(ranked[i]);
        listed[pair] = contacts[pair];
      }
    }
    return listed;
  }

  void check() {
    const std::map<Pair, Contact> now = expected();
    const auto got = limited_.contacts();
    REQUIRE(got.size() == now.size());
    REQUIRE(limited_.report().contacts == now.size());
    REQUIRE(limited_.report().unlisted == all_.contacts().size() - now.size());
    std::size_t i = 0, began = 0;
    for (auto [pair, contact] : now) {
      contact.phase = before_.count(pair) != 0 ? Phase::persist : Phase::begin;
      began += contact.phase == Phase::begin ? 1 : 0;
      REQUIRE(std::memcmp(&got[i++], &contact, sizeof contact) == 0);
    }
    REQUIRE(limited_.report().began == began);
    i = 0;
    const auto ended = limited_.ended();
    for (auto [pair, contact] : before_) {
      if (now.count(pair) != 0) continue;
      contact.phase = Phase::end;
      REQUIRE(i < ended.size());
      REQUIRE(std::memcmp(&ended[i++], &contact, sizeof contact) == 0);
    }
    REQUIRE(i == ended.size());
    unlisted += limited_.report().unlisted;
    count_passed(now);
    before_ = now;
  }

  // The nodes of both harnesses find the same contacts as long as none is lost and none joins or leaves.
  void count_passed(const std::map<Pair, Contact>& now) {
    std::map<Pair, Finding> found;
    const auto contacts = all_.contacts();
    for (std::size_t i = 0; i < contacts.size(); ++i) {
      const Pair pair(contacts[i].a, contacts[i].b);
      found[pair] = {all_.server().ledger().found(all_.last())[i].by, now.count(pair) != 0};
      const auto old = found_before_.find(pair);
      left_out_while_passed +=
          old != found_before_.end() && old->second.listed && !found[pair].listed && old->second.by != found[pair].by;
    }
    found_before_ = std::move(found);
  }

  TestHarness all_, limited_;
  std::mt19937_64 random_;
  std::vector<ShapeId> shapes_;
  std::vector<ObjectId> objects_;  ///< those that can move
  std::map<Pair, Contact> before_;
  std::map<Pair, Finding> found_before_;
};

template <class Test>
void in_all_harnesses(Test test) {
  for (const Deployment deployment : {Deployment::user_collision, Deployment::user_server}) {
    for (const Placement placement : {Placement::server, Placement::region}) {
      for (const bool shares_memory : {true, false}) {
        const std::string run_name = std::string(name_of(deployment)) + ", " + name_of(placement) +
                                     (shares_memory ? ", memory shared" : ", messages only");
        CAPTURE(run_name);
        HarnessConfig config;
        config.deployment = deployment;
        config.placement = placement;
        config.shares_memory = shares_memory;
        config.nodes = 4;
        config.grid = {{2, 2, 1}};
        config.model = &drifting;
        test(config);
      }
    }
  }
}

TEST_CASE(
    "listed are the deepest contacts of either object, with the phases of the list, also of pairs that change nodes") {
  in_all_harnesses([](const HarnessConfig& config) {
    for (unsigned seed = 1; seed < 4; ++seed) {
      CAPTURE(seed);
      Run run(config, seed);
      for (int frame = 0; frame < 60; ++frame) {
        CAPTURE(frame);
        run.frame();
      }
      CHECK(run.unlisted > 1000);
      CHECK(run.left_out_while_passed > 3);
    }
  });
}

TEST_CASE("the list stays limited while nodes join, leave and are lost") {
  in_all_harnesses([](const HarnessConfig& config) {
    for (unsigned seed = 11; seed < 14; ++seed) {
      CAPTURE(seed);
      Run run(config, seed);
      run.changes_nodes = true;
      for (int frame = 0; frame < 50; ++frame) {
        CAPTURE(frame);
        run.frame();
      }
      CHECK(run.unlisted > 1000);
    }
  });
}

}  // namespace
}  // namespace ringfence::nodes::test
