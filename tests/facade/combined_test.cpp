// Whatever may happen to a world, together and at random times: requests, lost nodes, resizes, and saves that continue
// in another deployment.
#include <cstdint>
#include <iterator>
#include <memory>
#include <random>
#include <vector>

#include <doctest/doctest.h>

#include "facade/queries/sensing_model.hpp"
#include "facade/script.hpp"
#include "geometry/ellipsoid.hpp"
#include "ringfence/save.hpp"
#include "ringfence/world.hpp"

namespace ringfence::test {
namespace {

constexpr int frames = 40;

/// Settings that contacts depend on, and draws of those that they do not depend on.
class Settings {
 public:
  explicit Settings(unsigned seed) {
    std::mt19937_64 random(seed);
    side = 5 + static_cast<double>(random() % 8);
    deepest_ = random() % 2 == 0 ? static_cast<std::uint32_t>(1 + random() % 4) : 0;
    loses_nodes = random() % 2 == 0;
  }

  /// A world in one thread.
  WorldConfig plain() const {
    WorldConfig config;
    config.bounds_max = {side, side, side};
    config.layers = {{"a", "b", "c"}, {{0, 0}, {0, 1}, {1, 1}, {2, 0}}};
    config.deepest_contacts = deepest_;
    config.sense = 4;
    config.motion = std::make_shared<SensingModel>(side, config.sense, false);
    config.support_functions = {nullptr, std::make_shared<Ellipsoid>(Vec3f{0.5f, 0.7f, 0.9f})};
    config.nodes = 0;
    return config;
  }

  WorldConfig drawn(std::mt19937_64& random) const {
    constexpr std::uint32_t nodes[] = {0, 1, 2, 3, 5, 9, 16};
    constexpr Deployment deployments[] = {Deployment::user, Deployment::user_server, Deployment::user_collision};
    WorldConfig config = plain();
    config.nodes = nodes[random() % std::size(nodes)];
    config.deployment = deployments[random() % std::size(deployments)];
    config.placement = random() % 2 == 0 ? Placement::region : Placement::server;
    config.interest = 1 + static_cast<double>(random() % 5);
    config.user_threads = static_cast<std::uint32_t>(1 + random() % 3);
    config.tuning.keep_resting = random() % 3 != 0;
    config.tuning.remember_axes = random() % 3 != 0;
    config.tuning.ring_bytes = random() % 3 == 0 ? 4096 : 0;
    config.deadlines.node_ms = loses_nodes ? 40 : 0;
    return config;
  }

  double side = 0;
  bool loses_nodes = false;

 private:
  std::uint32_t deepest_ = 0;
};

/// One of the nodes stops somewhere in the next frame, for a while or until release_faults().
void stop_a_node(World& world, std::mt19937_64& random) {
  const auto& nodes = world.report().nodes;
  if (nodes.empty()) return;
  Fault fault;
  fault.node = nodes[random() % nodes.size()].id;
  fault.frame = world.frames();
  fault.stage = static_cast<NodeStage>(random() % node_stage_count);
  fault.stall_ms = random() % 2 == 0 ? 90 : 0;
  fault.passes = static_cast<std::uint32_t>(random() % 2);
  (void)world.inject(fault);  // refused if the node has left, or runs in the server's thread
}

World continued(World& world, WorldConfig config) {
  MemorySink sink;
  REQUIRE(world.save(sink) == Status::ok);
  (void)world.release_faults();
  MemorySource source(sink.bytes());
  return World(std::move(config), source);
}

std::vector<std::uint64_t> plain_run(const Settings& settings, unsigned seed) {
  World world(settings.plain());
  Script script(world, seed, settings.side);
  std::vector<std::uint64_t> fingerprints;
  for (int frame = 0; frame < frames; ++frame) {
    REQUIRE(world.advance() == Status::ok);
    fingerprints.push_back(fingerprint(world));
    script.make_requests();
  }
  return fingerprints;
}

}  // namespace

TEST_CASE("requests, lost nodes, resizes and restores at random times change no state and no contact") {
  for (unsigned seed = 1; seed <= 5; ++seed) {
    const Settings settings(seed);
    const std::vector<std::uint64_t> expected = plain_run(settings, seed);
    for (unsigned draw = 0; draw < 2; ++draw) {
      std::mt19937_64 random(100 * seed + draw);
      World world(settings.drawn(random));
      Script script(world, seed, settings.side);
      for (int frame = 0; frame < frames; ++frame) {
        CAPTURE(seed);
        CAPTURE(draw);
        CAPTURE(frame);
        if (settings.loses_nodes && frame > 0 && random() % 6 == 0) stop_a_node(world, random);
        if (world.nodes() > 0 && random() % 8 == 0) {
          REQUIRE(world.resize(static_cast<std::uint32_t>(1 + random() % 10)) == Status::ok);
        }
        REQUIRE(world.advance() == Status::ok);
        REQUIRE(world.report().accepted == world.report().candidates);
        REQUIRE(fingerprint(world) == expected[static_cast<std::size_t>(frame)]);
        if (random() % 12 == 0) world = continued(world, settings.drawn(random));
        script.make_requests();
      }
      (void)world.release_faults();
    }
  }
}

}  // namespace ringfence::test
