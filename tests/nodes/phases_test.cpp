// Phases of contacts, whichever node finds them: nodes decide those inside their regions, the server the rest.
#include <algorithm>
#include <cmath>
#include <map>
#include <random>
#include <string>
#include <utility>
#include <vector>

#include <doctest/doctest.h>

#include "nodes/drifting_model.hpp"
#include "nodes/test_harness.hpp"

namespace ringfence::nodes::test {
namespace {

using Pair = std::pair<ObjectNumber, ObjectNumber>;

const DriftingModel drifting;

/// Minimum coverage of a run; without it the run would test nothing.
struct Coverage {
  std::size_t begun = 0, ended = 0;  ///< contacts
  std::size_t passed = 0;            ///< contacts that another node found in the frame before
  std::size_t alone = 0;             ///< begun or ended, decided by a node alone
};

/// Spheres that wander among nodes; every pair is compared with brute force in every frame.
class Run {
 public:
  Run(const HarnessConfig& config, unsigned seed) : harness_(config), random_(seed) {
    for (double& radius : radii_) {
      radius = 1 + static_cast<double>(&radius - radii_);
    }
    for (std::size_t k = 0; k < std::size(radii_); ++k) {
      shapes_[k] = harness_.add_shape(Sphere{static_cast<float>(radii_[k])});
    }
    for (int i = 0; i < 96; ++i) {
      spawn(i % 12 == 7 ? Category::fixed : Category::active);
    }
  }

  TestHarness& harness() { return harness_; }

  /// Spawns, ends and places objects, then runs a frame.
  void frame() {
    if (random_() % 3 == 0) {
      spawn(Category::active);
      const std::size_t at = random_() % objects_.size();
      harness_.destroy(objects_[at]);
      objects_.erase(objects_.begin() + static_cast<std::ptrdiff_t>(at));
      harness_.place(objects_[random_() % objects_.size()], {anywhere(), {}});
    }
    harness_.frame();
    check();
  }

  Coverage coverage;

 private:
  Vec3d anywhere() {
    const auto coordinate = [&] { return static_cast<double>(random_() % 620 + 10) / 10; };
    return {coordinate(), coordinate(), coordinate()};
  }
  void spawn(Category category) {
    ObjectSpec spec;
    spec.shape = shapes_[random_() % std::size(shapes_)];
    spec.category = category;
    if (++spawned_ % 8 == 1) {
      crowd_ = anywhere();
    }
    const auto off = [&] { return static_cast<double>(random_() % 60) / 10 - 3; };
    spec.pose.position = {crowd_.x + off(), crowd_.y + off(), crowd_.z + off()};
    const ObjectId id = harness_.spawn(spec);
    if (category != Category::fixed) {
      objects_.push_back(id);
    }
  }

  // Pairs whose surfaces are closer than the rounding error may be in contact or not.
  void check() {
    constexpr double rounding = 1e-4;
    const ObjectTable& table = harness_.table();
    std::map<Pair, NodeNumber> now;
    const auto contacts = harness_.contacts();
    const auto found = harness_.server().ledger().found(harness_.last());
    for (std::size_t i = 0; i < contacts.size(); ++i) {
      now[{contacts[i].a, contacts[i].b}] = found[i].by;
    }
    REQUIRE(now.size() == contacts.size());
    std::size_t touching = 0;
    for (std::uint32_t p = 0; p < table.slots(); ++p) {
      for (std::uint32_t q = 0; q < p; ++q) {
        if (table.present()[p] == 0 || table.present()[q] == 0) {
          continue;
        }
        const double gap = gap_between(p, q);
        const Pair pair = std::minmax(table.row(p).object.number, table.row(q).object.number);
        CAPTURE(pair.first);
        CAPTURE(pair.second);
        REQUIRE((std::abs(gap) < rounding || (now.count(pair) != 0) == (gap < 0)));
        touching += now.count(pair);
      }
    }
    REQUIRE(touching == now.size());
    for (const Contact& contact : contacts) {
      const auto old = before_.find({contact.a, contact.b});
      CAPTURE(contact.a);
      CAPTURE(contact.b);
      REQUIRE((contact.phase == Phase::persist) == (old != before_.end()));
      coverage.begun += old == before_.end() ? 1 : 0;
      coverage.passed += old != before_.end() && old->second != now[{contact.a, contact.b}] ? 1 : 0;
    }
    std::vector<Pair> gone, ended;
    for (const auto& entry : before_) {
      if (now.count(entry.first) == 0) {
        gone.push_back(entry.first);
      }
    }
    for (const Contact& contact : harness_.ended()) {
      REQUIRE(contact.phase == Phase::end);
      ended.push_back({contact.a, contact.b});
    }
    REQUIRE(ended == gone);
    REQUIRE(harness_.report().ended == gone.size());
    REQUIRE(harness_.report().began == now.size() + gone.size() - before_.size());
    coverage.ended += gone.size();
    for (NodeNumber node = 0; node < harness_.nodes() && harness_.config().shares_memory; ++node) {
      const NodeContacts& node_contacts = *harness_.node_contacts(node);
      coverage.alone += node_contacts.beginning.size() + node_contacts.ending.size() -
                        node_contacts.border_beginning.size() - node_contacts.border_ending.size();
    }
    before_ = now;
  }
  double gap_between(std::uint32_t p, std::uint32_t q) const {
    const Vec3d& a = harness_.server().pose(p).position;
    const Vec3d& b = harness_.server().pose(q).position;
    return std::hypot(a.x - b.x, a.y - b.y, a.z - b.z) - radius_of(p) - radius_of(q);
  }
  double radius_of(std::uint32_t slot) const {
    const ShapeNumber shape = harness_.table().row(slot).shape;
    return radii_[static_cast<std::size_t>(std::find(std::begin(shapes_), std::end(shapes_), ShapeId(shape)) -
                                           shapes_)];
  }

  TestHarness harness_;
  std::mt19937_64 random_;
  double radii_[3] = {};
  ShapeId shapes_[3] = {};
  std::vector<ObjectId> objects_;  ///< those that can move
  int spawned_ = 0;
  Vec3d crowd_;
  std::map<Pair, NodeNumber> before_;  ///< which node found them
};

HarnessConfig config_of(Deployment deployment, Placement placement, bool shares_memory) {
  HarnessConfig config;
  config.deployment = deployment;
  config.placement = placement;
  config.shares_memory = shares_memory;
  config.nodes = 4;
  config.grid = {{2, 2, 1}};
  config.model = &drifting;
  return config;
}

TEST_CASE("a pair that stays in contact while it moves between nodes persists, and no other pair does") {
  for (const Deployment deployment : {Deployment::user_collision, Deployment::user_server}) {
    for (const Placement placement : {Placement::server, Placement::region}) {
      for (const bool shares_memory : {true, false}) {
        for (unsigned seed = 1; seed < 4; ++seed) {
          CAPTURE(seed);
          const std::string run_name = std::string(name_of(deployment)) + ", " + name_of(placement) +
                                       (shares_memory ? ", memory shared" : ", messages only");
          CAPTURE(run_name);
          Run run(config_of(deployment, placement, shares_memory), seed);
          for (int frame = 0; frame < 60; ++frame) {
            CAPTURE(frame);
            run.frame();
          }
          CHECK(run.coverage.begun > 300);
          CHECK(run.coverage.ended > 300);
          CHECK(run.coverage.passed > 20);
          // Only nodes that host objects know that no other node can have found a contact.
          CHECK((run.coverage.alone > 200) == (shares_memory && deployment == Deployment::user_collision));
        }
      }
    }
  }
}

TEST_CASE("contacts begin and end correctly while nodes join, leave and are lost") {
  for (const Placement placement : {Placement::server, Placement::region}) {
    for (unsigned seed = 11; seed < 15; ++seed) {
      CAPTURE(seed);
      CAPTURE(name_of(placement));
      std::mt19937_64 random(seed);
      Run run(config_of(Deployment::user_collision, placement, true), seed);
      for (int frame = 0; frame < 60; ++frame) {
        CAPTURE(frame);
        if (random() % 5 == 0) {
          run.harness().resize(1 + static_cast<std::uint32_t>(random() % 6));
        } else if (random() % 5 == 0) {
          run.harness().kill(static_cast<NodeNumber>(random() % run.harness().nodes()), random() % 40);
        }
        run.frame();
      }
      CHECK(run.coverage.passed > 60);
      CHECK(run.coverage.alone > 100);
    }
  }
}

}  // namespace
}  // namespace ringfence::nodes::test
