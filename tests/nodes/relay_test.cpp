// What user nodes see of objects that they do not host is the same, whichever role publishes it.
#include <algorithm>
#include <cstddef>
#include <cstring>
#include <random>
#include <utility>
#include <vector>

#include <doctest/doctest.h>

#include "nodes/test_harness.hpp"

namespace ringfence::nodes::test {
namespace {

/// Some stand still, some wander over borders, some disappear and return; computed from number and frame only.
class RovingModel : public MotionModel {
 public:
  std::size_t state_bytes() const noexcept override { return 0; }
  void move(std::uint64_t frame, std::span<const MotionInput> inputs, std::span<MotionOutput> outputs) const override {
    for (std::size_t i = 0; i < inputs.size(); ++i) {
      const std::uint64_t number = inputs[i].number;
      if (number % 3 == 0) {
        continue;
      }
      std::uint64_t h = (frame * 64 + number) * 0x9e3779b97f4a7c15u;
      h ^= h >> 31;
      const auto step = [&](int shift) { return static_cast<double>(h >> shift & 15) - 7.5; };
      Vec3d& p = outputs[i].pose.position;
      p = {p.x + step(20), p.y + step(30), p.z + step(40)};
      for (double* x : {&p.x, &p.y, &p.z}) {
        *x = *x < 0 ? 0 : *x > 64 ? 64 : *x;
      }
      outputs[i].enabled = inputs[i].category == Category::avatar || number % 5 != 0 || (frame + number) % 4 != 0;
    }
  }
};
const RovingModel roving;

HarnessConfig config_of(Deployment deployment, Placement placement, bool shares) {
  HarnessConfig config;
  config.deployment = deployment;
  config.placement = placement;
  config.shares_memory = shares;
  config.model = &roving;
  config.grid = {{2, 2, 2}};
  config.interest = 12;
  config.delivery_bytes = std::size_t{1} << 17;
  return config;
}

template <class Perform>
void in_all_configs(Perform check) {
  for (const Deployment deployment : {Deployment::user, Deployment::user_server, Deployment::user_collision}) {
    for (const Placement placement : {Placement::server, Placement::region}) {
      for (const bool shares : {false, true}) {  // the server publishes, or the nodes
        CAPTURE(name_of(deployment));
        CAPTURE(name_of(placement));
        CAPTURE(shares);
        check(config_of(deployment, placement, shares));
      }
    }
  }
}

/// Spawns, destroys, places and users that come and go; views are checked after every frame.
class RelayRun {
 public:
  RelayRun(const HarnessConfig& config, unsigned seed) : harness(config), random_(seed) {
    ball_ = harness.add_shape(Sphere{2});
    for (UserNumber user = 0; user < 3; ++user) {
      connect(user);
    }
    for (int i = 0; i < 60; ++i) {
      spawn();
    }
  }

  void frame() {
    harness.frame();
    harness.require_views();
    if (harness.report().lost.empty()) {
      REQUIRE(harness.report().traffic[static_cast<std::size_t>(Traffic::state)].records == relayed() + reported());
    }
    for (std::uint64_t n = random_() % 4; n > 0; --n) {
      spawn();
    }
    for (std::uint64_t n = random_() % 4; n > 0; --n) {
      const std::size_t at = random_() % ids_.size();
      harness.destroy(ids_[at]);
      ids_[at] = ids_.back();
      ids_.pop_back();
      harness.place(ids_[random_() % ids_.size()], pose());
    }
    if (random_() % 4 == 0) {
      const UserNumber user = 1 + static_cast<UserNumber>(random_() % 2);
      is_connected_[user] ? harness.disconnect(user) : connect(user);
      is_connected_[user] = !is_connected_[user];
    }
  }

  TestHarness harness;

 private:
  Pose pose() {
    const auto at = [&] { return static_cast<double>(random_() % 64); };
    return {{at(), at(), at()}, {}};
  }
  void spawn() {
    ObjectSpec spec;
    spec.shape = ball_;
    spec.pose = pose();
    const auto kind = random_() % 8;
    spec.category = kind == 0 ? Category::fixed : kind < 4 ? Category::non_active : Category::active;
    spec.enabled = random_() % 9 != 0;
    ids_.push_back(harness.spawn(spec));
  }
  void connect(UserNumber user) {
    harness.connect(user);
    for (int avatar = 0; avatar < 2; ++avatar) {
      ObjectSpec spec;
      spec.shape = ball_;
      spec.pose = pose();
      spec.category = Category::avatar;
      spec.user = UserId(user);
      harness.spawn(spec);
    }
  }
  std::size_t relayed() const {
    std::size_t count = 0;
    const ObjectTable& table = harness.table();
    for (std::uint32_t slot = 0; slot < table.slots(); ++slot) {
      const auto category = static_cast<Category>(table.row(slot).category);
      const bool moves = category == Category::active || category == Category::non_active;
      count += table.alive(slot) && table.present()[slot] != 0 && moves && deployment() != Deployment::user ? 1 : 0;
    }
    return count;
  }
  /// States reported by the CD nodes, or kept where the server can read them.
  std::size_t reported() const {
    std::size_t count = 0;
    for (const LoggedMessage& message : harness.log()) {
      const bool states = message.type() == MessageType::node_state || message.type() == MessageType::replica;
      count += states ? message.header.count : 0;
      if (message.type() == MessageType::frame_done && message.from.is_node()) {
        count += message.record<messages::NodeFrameStats>(0).host_owned_changes;
      }
    }
    return count;
  }
  Deployment deployment() const { return harness.config().deployment; }

  std::mt19937_64 random_;
  ShapeId ball_;
  std::vector<ObjectId> ids_;
  bool is_connected_[3] = {true, true, true};
};

TEST_CASE("user nodes see the same whether the server or the CD nodes publish the hosted objects") {
  in_all_configs([](const HarnessConfig& config) {
    for (unsigned seed = 1; seed <= 6; ++seed) {
      CAPTURE(seed);
      RelayRun run(config, seed);
      for (int frame = 0; frame < 25; ++frame) {
        CAPTURE(frame);
        run.frame();
        run.harness.require_one_host_each();
      }
    }
  });
}

TEST_CASE("after a node is lost at any of its messages, user nodes see each object once, at its current pose") {
  in_all_configs([](const HarnessConfig& config) {
    for (NodeNumber node = 0; node < config.nodes; ++node) {
      for (std::size_t messages = 0; messages < 30; ++messages) {
        CAPTURE(node);
        CAPTURE(messages);
        RelayRun run(config, 9);
        for (int frame = 0; frame < 6; ++frame) {
          CAPTURE(frame);
          if (frame == 2) run.harness.kill(node, messages);
          run.frame();
        }
      }
    }
  });
}

TEST_CASE("user nodes read while nodes test, and a loss at that time does not change what they see") {
  for (const Placement placement : {Placement::server, Placement::region}) {
    const HarnessConfig config = config_of(Deployment::user_collision, placement, true);
    std::size_t lost_late = 0;
    for (NodeNumber node = 0; node < config.nodes; ++node) {
      for (std::size_t messages = 0; messages < 40; ++messages) {
        CAPTURE(node);
        CAPTURE(messages);
        RelayRun run(config, 9);
        for (int frame = 0; frame < 3; ++frame) run.frame();
        run.harness.kill(node, messages);
        run.frame();
        const auto of_node = [&](MessageType type) {
          return std::any_of(run.harness.log().begin(), run.harness.log().end(), [&](const LoggedMessage& seen) {
            return seen.from == Endpoint::node(node) && seen.type() == type;
          });
        };
        if (!run.harness.report().lost.empty() && of_node(MessageType::published) &&
            !of_node(MessageType::narrow_done)) {
          ++lost_late;
          // Nodes that have published do not publish again.
          REQUIRE(run.harness.relays().size() == config.nodes + 2);
        }
        run.frame();
      }
    }
    CHECK(lost_late >= config.nodes);
  }
}

/// What users have to say when their states can be read, held back until the CD nodes have tested for one round.
class HeldPublished {
 public:
  explicit HeldPublished(TestHarness& harness) {
    harness.tamper = [this](const LoggedMessage& seen, std::vector<std::vector<std::byte>>& instead) {
      if (seen.type() == MessageType::published) {
        held_.emplace_back(seen.from, seen.bytes);
        instead.clear();
      }
    };
    harness.between = [this, &harness] {
      const auto tested = std::count_if(harness.log().begin(), harness.log().end(), [](const LoggedMessage& seen) {
        return seen.type() == MessageType::narrow_done;
      });
      if (static_cast<std::size_t>(tested) < harness.nodes()) {
        rounds_ = 0;
      } else if (++rounds_ == 2) {  // the server has received all contacts
        for (const auto& [user, bytes] : held_) harness.from(user.number()).forge(bytes);
        held_.clear();
      }
    };
  }
  HeldPublished(const HeldPublished&) = delete;
  HeldPublished& operator=(const HeldPublished&) = delete;

 private:
  std::vector<std::pair<Endpoint, std::vector<std::byte>>> held_;
  int rounds_ = 0;
};

TEST_CASE(
    "a user thread that publishes after all nodes have tested is waited for, and every user node sees its states") {
  in_all_configs([](const HarnessConfig& config) {
    RelayRun run(config, 5);
    const HeldPublished held(run.harness);
    for (int frame = 0; frame < 12; ++frame) {
      CAPTURE(frame);
      run.frame();
      REQUIRE(run.harness.report().refused[static_cast<std::size_t>(Status::bad_message)] == 0);
    }
  });
}

TEST_CASE("losses of several nodes, together or one after another, do not change what user nodes see") {
  in_all_configs([](const HarnessConfig& config) {
    for (unsigned seed = 1; seed <= 30; ++seed) {
      CAPTURE(seed);
      std::mt19937_64 random(seed);
      RelayRun run(config, seed);
      for (int frame = 0; frame < 9; ++frame) {
        CAPTURE(frame);
        for (NodeNumber node = 0; node < run.harness.nodes(); ++node) {
          if (frame > 1 && random() % 3 == 0) run.harness.kill(node, random() % 24);
        }
        run.frame();
      }
    }
  });
}

TEST_CASE("nodes publish only states in their regions, so user nodes skip most publications") {
  RelayRun run(config_of(Deployment::user_collision, Placement::region, true), 3);
  for (int frame = 0; frame < 12; ++frame) {
    run.frame();
    const auto relays = run.harness.relays();
    REQUIRE(relays.size() >= 3);  // and those of the user nodes
    for (const Published* relay : relays) {
      const auto states = relay->publication->states(run.harness.last());
      Vec3d low = states.front().pose.position, high = low;
      for (const PublishedState& state : states) {
        const Vec3d& p = state.pose.position;
        low = {std::min(low.x, p.x), std::min(low.y, p.y), std::min(low.z, p.z)};
        high = {std::max(high.x, p.x), std::max(high.y, p.y), std::max(high.z, p.z)};
      }
      const geometry::CornerBox& bounds = relay->bounds[run.harness.last() & 1];
      REQUIRE(bounds.lower == low);
      REQUIRE(bounds.upper == high);
    }
  }
}

}  // namespace
}  // namespace ringfence::nodes::test
