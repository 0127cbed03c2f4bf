#include <algorithm>
#include <cmath>
#include <cstring>
#include <vector>

#include <doctest/doctest.h>

#include "geometry/vector.hpp"
#include "narrow_phase/convex_world.hpp"
#include "narrow_phase/narrow_phase.hpp"

namespace ringfence::narrow_phase_test {
namespace {

using narrow_phase::NarrowPhase;
using narrow_phase::PairContact;

/// Moves and rotates each body by as much as an object moves in one frame.
class Motion {
 public:
  Motion(std::vector<narrow_phase::Body>& bodies, std::uint64_t seed) : bodies_(bodies) {
    RandomSource random(seed);
    for (std::size_t i = 0; i < bodies.size(); ++i) {
      step_.push_back(random.vector(0, 0.03));
      spin_.push_back(random.vector(0, 0.02));
    }
  }
  void advance() {
    for (std::size_t i = 0; i < bodies_.size(); ++i) {
      Pose& pose = bodies_[i].pose;
      pose.position = pose.position + step_[i];
      const Quat q = pose.orientation;
      const Vec3f s = to_float(spin_[i]);
      pose.orientation =
          geometry::normalise({q.x + s.x * q.w + s.y * q.z - s.z * q.y, q.y + s.y * q.w + s.z * q.x - s.x * q.z,
                               q.z + s.z * q.w + s.x * q.y - s.y * q.x, q.w - s.x * q.x - s.y * q.y - s.z * q.z});
    }
  }

 private:
  std::vector<narrow_phase::Body>& bodies_;
  std::vector<Vec3d> step_, spin_;
};

bool same_bits(std::span<const PairContact> p, std::span<const PairContact> q) {
  return p.size() == q.size() && std::memcmp(p.data(), q.data(), p.size_bytes()) == 0;
}

}  // namespace

TEST_CASE("cached axes never change a contact: kept, cleared at random, in a small table, or those of other pairs") {
  for (const bool degenerate : {false, true}) {
    const std::uint64_t seed = 51;
    INFO("nasty ", degenerate, ", seed ", seed);
    PairWorld world = (degenerate ? degenerate_convex_pairs : ordinary_convex_pairs)(ShapeKind::hull, ShapeKind::hull,
                                                                                     1500, seed, {});
    Motion motion(world.bodies, seed + 1);
    NarrowPhase off(world.shapes()), kept(world.shapes()), cleared(world.shapes()), mistaken(world.shapes());
    for (NarrowPhase* narrow_phase : {&kept, &cleared, &mistaken}) narrow_phase->remember_axes(true);
    NarrowPhase small(world.shapes());
    small.remember_axes(true, 1);
    RandomSource random(seed + 2);
    std::vector<narrow_phase::Body> renumbered = world.bodies;
    for (int frame = 0; frame < 30; ++frame) {
      const auto expected = off.test(world.bodies, world.pairs);
      REQUIRE(same_bits(kept.test(world.bodies, world.pairs), expected));
      REQUIRE(same_bits(small.test(world.bodies, world.pairs), expected));
      if (random.below(3) == 0) cleared.forget_axes();
      REQUIRE(same_bits(cleared.test(world.bodies, world.pairs), expected));
      // The numbers rotate among the bodies, so each pair finds the axis that another pair has stored.
      for (std::size_t i = 0; i < renumbered.size(); ++i) {
        renumbered[i].pose = world.bodies[i].pose;
        renumbered[i].number =
            static_cast<ObjectNumber>((i + 2 * static_cast<std::size_t>(frame)) % renumbered.size() + 1);
      }
      REQUIRE(same_bits(mistaken.test(renumbered, world.pairs), expected));
      motion.advance();
    }
    CHECK(off.counters(ShapeKind::hull, ShapeKind::hull).ended_early == 0);
    CHECK(kept.counters(ShapeKind::hull, ShapeKind::hull).ended_early > 200);
    CHECK(cleared.counters(ShapeKind::hull, ShapeKind::hull).ended_early > 100);
    CHECK(small.counters(ShapeKind::hull, ShapeKind::hull).ended_early > 100);
    CHECK(kept.counters(ShapeKind::hull, ShapeKind::hull).ended_early >
          cleared.counters(ShapeKind::hull, ShapeKind::hull).ended_early);
  }
}

}  // namespace ringfence::narrow_phase_test
