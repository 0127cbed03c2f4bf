// What user nodes see of what they do not host: the same, whoever tells them.
#include <algorithm>
#include <cstring>
#include <random>
#include <vector>

#include <doctest/doctest.h>

#include "nodes/test_harness.hpp"

namespace ringfence::nodes::test {
namespace {

/// Some stand still, some wander over borders, some vanish and come back; all of it from number and frame alone.
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
      outputs[i].present = inputs[i].category == Category::avatar || number % 5 != 0 || (frame + number) % 4 != 0;
    }
  }
};
const RovingModel roving;

HarnessConfig config_of(Deployment deployment, Placement placement, bool shares) {
  HarnessConfig play;
  play.deployment = deployment;
  play.placement = placement;
  play.shares_memory = shares;
  play.model = &roving;
  play.grid = {{2, 2, 2}};
  play.interest = 12;
  play.delivery_bytes = std::size_t{1} << 17;
  return play;
}

template <class Perform>
void in_all_configs(Perform perform) {
  for (const Deployment deployment : {Deployment::user, Deployment::user_server, Deployment::user_collision}) {
    for (const Placement placement : {Placement::server, Placement::region}) {
      for (const int publish : {0, 1, 2}) {  // nobody, all, some
        CAPTURE(name_of(deployment));
        CAPTURE(name_of(placement));
        CAPTURE(publish);
        HarnessConfig play = config_of(deployment, placement, publish != 0);
        play.all_publish = publish == 1;
        perform(play);
      }
    }
  }
}

/// Spawns, destroys, places and users that come and go, and what is seen after every frame.
class RelayRun {
 public:
  RelayRun(const HarnessConfig& play, unsigned seed) : harness(play), random_(seed) {
    ball_ = harness.add_shape(Sphere{2});
    for (UserNumber user = 0; user < 3; ++user) {
      enter(user);
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
      here_[user] ? harness.disconnect(user) : enter(user);
      here_[user] = !here_[user];
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
    spec.present = random_() % 9 != 0;
    ids_.push_back(harness.spawn(spec));
  }
  void enter(UserNumber user) {
    harness.connect(user);
    for (int avatar = 0; avatar < 2; ++avatar) {
      ObjectSpec spec;
      spec.shape = ball_;
      spec.pose = pose();
      spec.category = Category::avatar;
      spec.user = user;
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
  /// By the CD nodes to the server, or kept where it can read them.
  std::size_t reported() const {
    std::size_t count = 0;
    for (const LoggedMessage& message : harness.log()) {
      count += message.type() == MessageType::node_state ? message.header.count : 0;
      if (message.type() == MessageType::frame_done && message.from.is_node()) {
        count += message.record<messages::NodeFrameStats>(0).host_owned_changes;
      }
    }
    return count;
  }
  Deployment deployment() const { return harness.play().deployment; }

  std::mt19937_64 random_;
  ShapeNumber ball_ = 0;
  std::vector<ObjectId> ids_;
  bool here_[3] = {true, true, true};
};

TEST_CASE("user nodes see the same whether the server relays or each CD node publishes what it hosts") {
  in_all_configs([](const HarnessConfig& play) {
    for (unsigned seed = 1; seed <= 6; ++seed) {
      CAPTURE(seed);
      RelayRun life(play, seed);
      for (int frame = 0; frame < 25; ++frame) {
        CAPTURE(frame);
        life.frame();
        life.harness.require_one_host_each();
      }
    }
  });
}

TEST_CASE("after a node is lost, by whatever of its messages, user nodes see each object once and as it stands") {
  in_all_configs([](const HarnessConfig& play) {
    for (NodeNumber node = 0; node < play.nodes; ++node) {
      for (std::size_t messages = 0; messages < 30; ++messages) {
        CAPTURE(node);
        CAPTURE(messages);
        RelayRun life(play, 9);
        for (int frame = 0; frame < 6; ++frame) {
          CAPTURE(frame);
          if (frame == 2) life.harness.kill(node, messages);
          life.frame();
        }
      }
    }
  });
}

TEST_CASE("user nodes look while nodes test, and what they see stands though a node is lost then") {
  for (const Placement placement : {Placement::server, Placement::region}) {
    const HarnessConfig play = config_of(Deployment::user_collision, placement, true);
    std::size_t lost_late = 0;
    for (NodeNumber node = 0; node < play.nodes; ++node) {
      for (std::size_t messages = 0; messages < 40; ++messages) {
        CAPTURE(node);
        CAPTURE(messages);
        RelayRun life(play, 9);
        for (int frame = 0; frame < 3; ++frame) life.frame();
        life.harness.kill(node, messages);
        life.frame();
        const auto of_node = [&](MessageType type) {
          return std::any_of(life.harness.log().begin(), life.harness.log().end(), [&](const LoggedMessage& seen) {
            return seen.from == Endpoint::node(node) && seen.type() == type;
          });
        };
        if (!life.harness.report().lost.empty() && of_node(MessageType::published) &&
            !of_node(MessageType::narrow_done)) {
          ++lost_late;
          // Nobody tells again what it has told.
          REQUIRE(life.harness.relays().size() == play.nodes);
        }
        life.frame();
      }
    }
    CHECK(lost_late >= play.nodes);
  }
}

TEST_CASE("nodes that are lost together, or one after another to the last, take nothing from what user nodes see") {
  in_all_configs([](const HarnessConfig& play) {
    for (unsigned seed = 1; seed <= 30; ++seed) {
      CAPTURE(seed);
      std::mt19937_64 random(seed);
      RelayRun life(play, seed);
      for (int frame = 0; frame < 9; ++frame) {
        CAPTURE(frame);
        for (NodeNumber node = 0; node < life.harness.nodes(); ++node) {
          if (frame > 1 && random() % 3 == 0) life.harness.kill(node, random() % 24);
        }
        life.frame();
      }
    }
  });
}

TEST_CASE("what nodes publish lies in their regions, so that user nodes pass over most of it") {
  RelayRun life(config_of(Deployment::user_collision, Placement::region, true), 3);
  for (int frame = 0; frame < 12; ++frame) {
    life.frame();
    const auto relays = life.harness.relays();
    REQUIRE(relays.size() == 3);
    for (const Published* relay : relays) {
      const auto cells = relay->publication->cells(life.harness.last());
      const regions::CellBox& cell_range = relay->cell_range[life.harness.last() & 1];
      regions::CellBox exact = life.harness.play().grid.box_of(cells.front());
      for (const std::uint32_t cell : cells) {
        const regions::CellBox at = life.harness.play().grid.box_of(cell);
        REQUIRE(cell_range.contains(at));
        for (std::size_t axis = 0; axis < 3; ++axis) {
          exact.lower[axis] = std::min(exact.lower[axis], at.lower[axis]);
          exact.upper[axis] = std::max(exact.upper[axis], at.upper[axis]);
        }
      }
      REQUIRE(cell_range == exact);
    }
  }
}

}  // namespace
}  // namespace ringfence::nodes::test
