// A CD node that stops after any of its messages: the contacts of that frame and of all later ones are those of a run
// without a loss.
#include <cstring>
#include <functional>
#include <random>
#include <string>
#include <vector>

#include <doctest/doctest.h>

#include "nodes/test_harness.hpp"
#include "nodes/wandering_model.hpp"

namespace ringfence::nodes::test {
namespace {

constexpr std::size_t objects = 50;

const WanderingModel wandering;

void populate(TestHarness& harness) {
  std::mt19937 random(3);
  const ShapeId ball = harness.add_shape(Sphere{6});
  harness.connect(0);
  harness.connect(1);
  for (std::size_t i = 0; i < objects; ++i) {
    ObjectSpec spec;
    spec.shape = ball;
    spec.pose.position = {static_cast<double>(random() % 60), static_cast<double>(random() % 60),
                          static_cast<double>(random() % 60)};
    spec.category = i < 2 ? Category::avatar : i == 49 ? Category::fixed : Category::active;
    spec.user = i < 2 ? UserId(static_cast<std::uint32_t>(i)) : no_user;
    harness.spawn(spec);
  }
}

using Frames = std::vector<std::vector<Contact>>;

std::vector<Contact> contacts_of(const TestHarness& harness) {
  return {harness.contacts().begin(), harness.contacts().end()};
}
bool same(const std::vector<Contact>& p, const std::vector<Contact>& q) {
  return p.size() == q.size() && std::memcmp(p.data(), q.data(), p.size() * sizeof(Contact)) == 0;
}

constexpr std::size_t frames = 9;

Frames undisturbed(const HarnessConfig& config) {
  TestHarness harness(config);
  populate(harness);
  Frames all;
  for (std::size_t frame = 0; frame < frames; ++frame) {
    harness.frame();
    all.push_back(contacts_of(harness));
  }
  return all;
}

void in_all_configs(const std::function<void(const HarnessConfig&, const Frames&)>& body) {
  for (const Deployment deployment : {Deployment::user, Deployment::user_server, Deployment::user_collision}) {
    for (int form = 0; form < 4; ++form) {
      const Placement placement = form % 2 == 0 ? Placement::server : Placement::region;
      const bool shares = form / 2 != 0;
      CAPTURE(name_of(deployment));
      CAPTURE(name_of(placement));
      CAPTURE(shares);
      HarnessConfig config;
      config.shares_memory = shares;
      config.deployment = deployment;
      config.placement = placement;
      config.model = &wandering;
      config.grid = {{2, 2, 2}};
      config.delivery_bytes = std::size_t{1} << 17;
      body(config, undisturbed(config));
    }
  }
}

/// Runs all frames; `before(frame)` may stop nodes. Returns the number of lost nodes.
std::size_t run_frames(TestHarness& harness, const Frames& expected, const std::function<void(std::size_t)>& before) {
  std::size_t lost = 0;
  for (std::size_t frame = 0; frame < expected.size(); ++frame) {
    CAPTURE(frame);
    before(frame);
    harness.frame();
    const FrameReport& report = harness.report();
    REQUIRE(same(contacts_of(harness), expected[frame]));
    REQUIRE(report.accepted == report.candidates);
    if (report.lost.empty()) {
      harness.require_one_host_each();
    }
    lost += report.lost.size();
  }
  return lost;
}

TEST_CASE("a node that is lost after any of its messages changes no contact, of that frame or a later one") {
  in_all_configs([](const HarnessConfig& config, const Frames& expected) {
    REQUIRE(expected.back().size() > 5);
    std::size_t losses = 0;
    for (NodeNumber node = 0; node < config.nodes; ++node) {
      // Until the node survives the frame.
      for (std::size_t messages = 0;; ++messages) {
        CAPTURE(node);
        CAPTURE(messages);
        TestHarness harness(config);
        populate(harness);
        const std::size_t lost = run_frames(harness, expected, [&](std::size_t frame) {
          if (frame == 3) harness.kill(node, messages);
        });
        REQUIRE(lost <= 1);
        losses += lost;
        REQUIRE(harness.nodes() == config.nodes - lost);
        if (messages > 40) {
          break;
        }
      }
    }
    CHECK(losses > 20);
  });
}

TEST_CASE("nodes that are lost one after another, including the last and its replacements, change no contact") {
  in_all_configs([](const HarnessConfig& config, const Frames& expected) {
    for (std::size_t messages = 0; messages < 20; ++messages) {
      CAPTURE(messages);
      TestHarness harness(config);
      populate(harness);
      const std::size_t lost = run_frames(harness, expected, [&](std::size_t frame) {
        if (frame >= 2 && frame < 6) harness.kill(static_cast<NodeNumber>(frame % harness.nodes()), messages);
      });
      // In a process a node sends and receives fewer messages in a frame, so it may have completed it before.
      CHECK(lost >= (messages < (config.shares_memory ? 7 : 8) ? 4 : 2));
      CHECK(harness.nodes() == (lost < config.nodes ? config.nodes - lost : 1));
    }
  });
}

TEST_CASE(
    "a lost node whose thread stops inside a read gate delays a frame until the deadline and changes no contact") {
  in_all_configs([](HarnessConfig config, const Frames& expected) {
    if (!config.shares_memory) {
      return;
    }
    config.node_deadline_ns = 20'000'000;
    for (const auto gate : {TestHarness::GateOf::lists, TestHarness::GateOf::ghost_updates}) {
      if (gate == TestHarness::GateOf::ghost_updates && config.placement != Placement::region) {
        continue;
      }
      for (NodeNumber node = 0; node < config.nodes; ++node) {
        CAPTURE(static_cast<int>(gate));
        CAPTURE(node);
        TestHarness harness(config);
        populate(harness);
        const std::size_t lost = run_frames(harness, expected, [&](std::size_t frame) {
          if (frame == 3) harness.stop_inside(node, gate);
          if (frame == 4) harness.resize(config.nodes);
        });
        CHECK(lost >= config.nodes);
        CHECK(harness.nodes() >= 1);
      }
    }
  });
}

TEST_CASE("nodes that are lost in the same frame change no contact, even if all are") {
  in_all_configs([](const HarnessConfig& config, const Frames& expected) {
    for (std::size_t first = 0; first < 12; first += 2) {
      for (std::size_t second = 0; second < 12; second += 3) {
        for (const bool all : {false, true}) {
          CAPTURE(first);
          CAPTURE(second);
          CAPTURE(all);
          TestHarness harness(config);
          populate(harness);
          run_frames(harness, expected, [&](std::size_t frame) {
            if (frame != 3) return;
            harness.kill(0, first);
            harness.kill(2, second);
            if (all) harness.kill(1, 7);
          });
        }
      }
    }
  });
}

TEST_CASE("objects that are spawned, placed and destroyed around a loss have one host and the same contacts") {
  in_all_configs([](const HarnessConfig& config, const Frames&) {
    const auto life = [&](bool kills, std::size_t messages) {
      TestHarness harness(config);
      populate(harness);
      std::mt19937 random(17);
      std::vector<ObjectId> more;
      Frames all;
      for (std::size_t frame = 0; frame < frames; ++frame) {
        for (int i = 0; i < 4; ++i) {
          ObjectSpec spec;
          spec.pose.position = {static_cast<double>(random() % 60), 30, 30};
          spec.category = Category::active;
          more.push_back(harness.spawn(spec));
        }
        if (frame > 1) {
          const auto at = more.begin() + static_cast<std::ptrdiff_t>(random() % more.size());
          harness.destroy(*at);
          more.erase(at);
          harness.place(more.back(), {{5, 5, 5}, {}});
          harness.place(more.front(), {{55, 5, 5}, {}});
        }
        if (kills && (frame == 3 || frame == 4)) {
          harness.kill(1, messages);
        }
        harness.frame();
        all.push_back(contacts_of(harness));
        if (harness.report().lost.empty()) {
          harness.require_one_host_each();
        }
      }
      return all;
    };
    const Frames expected = life(false, 0);
    for (std::size_t messages = 0; messages < 24; ++messages) {
      CAPTURE(messages);
      const Frames disturbed = life(true, messages);
      for (std::size_t frame = 0; frame < frames; ++frame) {
        CAPTURE(frame);
        REQUIRE(same(disturbed[frame], expected[frame]));
      }
    }
  });
}

}  // namespace
}  // namespace ringfence::nodes::test
