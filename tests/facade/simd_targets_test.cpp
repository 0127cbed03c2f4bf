#include <string>
#include <vector>

#include <doctest/doctest.h>

#include "motion/steering.hpp"
#include "narrow_phase/targets.hpp"
#include "ringfence/digest.hpp"
#include "ringfence/world.hpp"
#include "worlds/load.hpp"
#include "worlds/paper_world.hpp"

namespace ringfence::test {
namespace {

using worlds::ShapeSetting;

/// Restores the choice of target also when a check fails.
struct ForcedTarget {
  explicit ForcedTarget(const std::string& name) { narrow_phase::force_target(name); }
  ~ForcedTarget() { narrow_phase::force_target(""); }
};

struct Run {
  std::uint64_t digest = 0;
  std::uint64_t contacts = 0;
  std::uint64_t ended_early = 0;
  std::uint64_t handed_over = 0;
};

constexpr std::uint32_t users = 8;

worlds::PaperWorldOptions options_of(ShapeSetting shapes) {
  worlds::PaperWorldOptions options;
  options.objects = 400;
  options.users = users;
  options.shapes = shapes;
  options.coverage = 0.12;
  return options;
}

WorldConfig config_of(Placement placement, std::uint32_t nodes) {
  WorldConfig config;
  config.placement = placement;
  config.nodes = nodes;
  return config;
}

Run run(const worlds::PaperWorld& paper, WorldConfig config, int frames) {
  config.motion = std::make_shared<motion::Steering>(paper.steering);
  worlds::configure_for(config, paper.scene, users);
  World world(config);
  worlds::load_into(world, paper.scene, users);
  Digest digest;
  Run result;
  for (int frame = 0; frame < frames; ++frame) {
    REQUIRE(world.advance() == Status::ok);
    REQUIRE(world.report().tested + world.report().carried == world.report().candidates);
    digest.add_frame(world.contacts());
    result.contacts += world.contacts().size();
    result.handed_over += world.report().handed_over;
    for (const KindReport& kind : world.report().kinds) result.ended_early += kind.ended_early;
  }
  result.digest = digest.value();
  return result;
}

}  // namespace

TEST_CASE("a whole run has one digest on every instruction set of the machine, for every setting of shapes") {
  for (const ShapeSetting shapes : {ShapeSetting::sphere, ShapeSetting::box, ShapeSetting::capsule, ShapeSetting::hull,
                                    ShapeSetting::mixed, ShapeSetting::mesh}) {
    CAPTURE(name_of(shapes));
    const worlds::PaperWorld paper = worlds::make_paper_world(options_of(shapes));
    const Run expected = run(paper, config_of(Placement::server, 0), 10);
    REQUIRE(expected.contacts > 500);
    for (const std::string& target : narrow_phase::targets()) {
      CAPTURE(target);
      const ForcedTarget forced(target);
      for (const Placement placement : {Placement::server, Placement::region}) {
        CAPTURE(name_of(placement));
        for (const std::uint32_t nodes : {0u, 1u, 3u}) {
          CAPTURE(nodes);
          const Run got = run(paper, config_of(placement, nodes), 10);
          CHECK(got.digest == expected.digest);
          CHECK(got.contacts == expected.contacts);
        }
      }
    }
  }
}

TEST_CASE("a whole run has one digest whether separating axes are remembered or not, also across hand-overs") {
  for (const ShapeSetting shapes : {ShapeSetting::hull, ShapeSetting::mixed}) {
    CAPTURE(name_of(shapes));
    const worlds::PaperWorld paper = worlds::make_paper_world(options_of(shapes));
    for (const std::uint32_t nodes : {0u, 1u, 3u}) {
      CAPTURE(nodes);
      WorldConfig config = config_of(Placement::server, nodes);
      config.tuning.remember_axes = false;
      const Run without = run(paper, config, 60);
      config.tuning.remember_axes = true;
      const Run with = run(paper, config, 60);
      CHECK(with.digest == without.digest);
      CHECK(without.ended_early == 0);
      CHECK(with.ended_early > 20);
      if (nodes == 3) CHECK(with.handed_over > 0);
    }
  }
}

}  // namespace ringfence::test
