#include "narrow_phase/targets.hpp"

#include <string>
#include <vector>

#include <doctest/doctest.h>

#include "motion/steering.hpp"
#include "narrow_phase/narrow_phase.hpp"
#include "ringfence/digest.hpp"
#include "ringfence/world.hpp"
#include "worlds/load.hpp"
#include "worlds/paper_world.hpp"

namespace ringfence::test {
namespace {

using worlds::ShapeSetting;

/// Gives the choice of target back also when a check fails.
struct ForcedTarget {
  explicit ForcedTarget(const std::string& name) { narrow_phase::force_target(name); }
  ~ForcedTarget() { narrow_phase::force_target(""); }
};

struct Run {
  std::uint64_t digest = 0;
  std::uint64_t contacts = 0;
};

Run run(const worlds::PaperWorld& paper, UserNumber users, Placement placement, std::uint32_t nodes, int frames) {
  WorldConfig config;
  config.placement = placement;
  config.nodes = nodes;
  config.motion = std::make_shared<motion::Steering>(paper.steering);
  worlds::configure_for(config, paper.scene, users);
  World world(config);
  worlds::load_into(world, paper.scene, users);
  Digest digest;
  Run result;
  for (int frame = 0; frame < frames; ++frame) {
    REQUIRE(world.advance() == Status::ok);
    REQUIRE(world.report().tested == world.report().candidates);
    digest.add_frame(world.contacts());
    result.contacts += world.contacts().size();
  }
  result.digest = digest.value();
  return result;
}

}  // namespace

TEST_CASE("a whole run has one digest on every instruction set that the machine has, for every setting of shapes") {
  constexpr UserNumber users = 8;
  for (const ShapeSetting shapes : {ShapeSetting::sphere, ShapeSetting::box, ShapeSetting::capsule, ShapeSetting::hull,
                                    ShapeSetting::mixed, ShapeSetting::mesh}) {
    if (shapes == ShapeSetting::mesh && !narrow_phase::can_test(ShapeKind::mesh, ShapeKind::mesh)) continue;
    CAPTURE(name_of(shapes));
    worlds::PaperWorldOptions options;
    options.objects = 400;
    options.users = users;
    options.shapes = shapes;
    options.coverage = 0.12;
    const worlds::PaperWorld paper = worlds::make_paper_world(options);
    const Run expected = run(paper, users, Placement::server, 0, 10);
    REQUIRE(expected.contacts > 500);
    for (const std::string& target : narrow_phase::targets()) {
      CAPTURE(target);
      const ForcedTarget forced(target);
      for (const Placement placement : {Placement::server, Placement::region}) {
        CAPTURE(name_of(placement));
        for (const std::uint32_t nodes : {0u, 1u, 3u}) {
          CAPTURE(nodes);
          const Run got = run(paper, users, placement, nodes, 10);
          CHECK(got.digest == expected.digest);
          CHECK(got.contacts == expected.contacts);
        }
      }
    }
  }
}

}  // namespace ringfence::test
