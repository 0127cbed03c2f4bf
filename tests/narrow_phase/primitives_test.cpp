#include <doctest/doctest.h>

#include "narrow_phase/narrow_phase.hpp"
#include "narrow_phase/pair_world.hpp"

using namespace ringfence;
using namespace ringfence::narrow_phase_test;

namespace {

constexpr ShapeKind primitives[] = {ShapeKind::sphere, ShapeKind::box, ShapeKind::capsule};

/// Every ordered pair of primitive kinds, so flipped ones too.
template <class Check>
void for_each_kinds(const Check& check) {
  for (const ShapeKind p : primitives) {
    for (const ShapeKind q : primitives) check(p, q);
  }
}

void check_right(const PairWorld& world, ShapeKind p, ShapeKind q, std::uint64_t seed, double relative) {
  narrow_phase::NarrowPhase narrow_phase(*world.table);
  const CheckResult result = check_contacts(world, world.pairs, narrow_phase.test(world.bodies, world.pairs), relative);
  INFO(name_of(p), " ", name_of(q), ", seed ", seed, ": ", result.wrong, " of ", world.pairs.size(), " wrong\n",
       result.text);
  CHECK(result.wrong == 0);
  CHECK(result.contacts * 5 > world.pairs.size());
}

}  // namespace

TEST_CASE("contacts of ordinary pairs match the reference within 10^-5 of the size") {
  for_each_kinds([](ShapeKind p, ShapeKind q) {
    const std::uint64_t seed = 1;
    check_right(ordinary_pairs(p, q, 8000, seed), p, q, seed, 1e-5);
  });
}

TEST_CASE("contacts a million metres from the origin are as precise as the positions") {
  for_each_kinds([](ShapeKind p, ShapeKind q) {
    const std::uint64_t seed = 2;
    check_right(ordinary_pairs(p, q, 1000, seed, {1e6, -1e6, 1e6}), p, q, seed, 1e-5);
  });
}

TEST_CASE("contacts of hard cases are right") {
  for_each_kinds([](ShapeKind p, ShapeKind q) {
    const std::uint64_t seed = 3;
    check_right(degenerate_pairs(p, q, 8000, seed), p, q, seed, 1e-4);
  });
}

TEST_CASE("boxes that touch at a common corner, or at edges selected by rounding, have a contact point within both") {
  // From worlds of 4000 boxes. Their contact points were once up to 11 mm outside.
  struct Placed {
    Box box;
    Pose pose;
  };
  const Placed found[][2] = {
      {{Box{{1.1737397909164429f, 0.6323973536491394f, 1.0215699672698975f}},
        {{5.631282625201543, 42.04808379173358, 49.02445125081971},
         {0.42613714933395386f, 0.7995269894599915f, -0.400480717420578f, 0.1370365470647812f}}},
       {Box{{0.6428971886634827f, 1.1986631155014038f, 1.0324817895889282f}},
        {{6.077719642020346, 43.67600572480623, 50.26037929026971},
         {-0.22807994484901428f, 0.3779991865158081f, 0.6955294609069824f, 0.5668641328811646f}}}},
      {{Box{{1.0355380773544312f, 1.1714097261428833f, 1.068757176399231f}},
        {{55.826190986058315, 4.680355790358654, 70.97262538323687},
         {-0.01553548127412796f, -0.6765265464782715f, 0.21510374546051025f, -0.7041314244270325f}}},
       {Box{{0.9708707332611084f, 0.7557767033576965f, 0.8771246075630188f}},
        {{56.32487255692699, 5.644509829497601, 68.79689282495211},
         {0.04232967272400856f, -0.5969573855400085f, 0.8001177906990051f, -0.04076520726084709f}}}},
  };
  PairWorld world;
  for (const auto& [a, b] : found) world.add_pair(a.box, a.pose, b.box, b.pose);
  narrow_phase::NarrowPhase narrow_phase(*world.table);
  const CheckResult result = check_contacts(world, world.pairs, narrow_phase.test(world.bodies, world.pairs), 1e-4);
  INFO(result.text);
  CHECK(result.contacts == world.pairs.size());
  CHECK(result.wrong == 0);
}

TEST_CASE("the contacts of 100,000 pairs of boxes as in the paper's world are right") {
  const std::uint64_t seed = 5;
  check_right(ordinary_pairs(ShapeKind::box, ShapeKind::box, 100'000, seed), ShapeKind::box, ShapeKind::box, seed,
              1e-4);
}

TEST_CASE("a capsule beside an edge of a box, nearly parallel to it, is as deep as their distance says") {
  const unsigned seed = 19;
  CAPTURE(seed);
  RandomSource random(seed);
  PairWorld world;
  for (int i = 0; i < 20'000; ++i) {
    const double length = random.logarithmic(0.5, 50);
    const double beside = random.logarithmic(0.02, 2);
    const Box box{{static_cast<float>(random.uniform(0.1, 5)), static_cast<float>(random.uniform(0.1, 5)),
                   static_cast<float>(length)}};
    const Vec3d gap = Vec3d{random.uniform(0.1, 1), random.uniform(0.1, 1), 0} * beside;
    // The edge ends within the capsule's length, so the nearest point is where the edge ends.
    const Capsule capsule{static_cast<float>(beside * random.uniform(0.5, 3)),
                          static_cast<float>(length * random.uniform(1, 2))};
    const double tilt = random.logarithmic(1e-7, 1e-3);
    Pose at;
    at.position = Vec3d{box.half_extents.x, box.half_extents.y, random.uniform(-0.3, 0.3) * length} + gap;
    at.orientation = {static_cast<float>(tilt * random.uniform(-1, 1)),
                      static_cast<float>(tilt * random.uniform(-1, 1)), 0, 1};
    world.add_pair(box, {}, capsule, at);
  }
  narrow_phase::NarrowPhase narrow_phase(world.shapes());
  const CheckResult result = check_contacts(world, world.pairs, narrow_phase.test(world.bodies, world.pairs), 1e-4);
  CHECK(result.contacts > 5000);
  CHECK_MESSAGE(result.wrong == 0, result.text);
}

TEST_CASE("capsules whose nearest point is just inside an end have a normal perpendicular to that segment") {
  // From worlds of 4000 capsules. Rounding once selected the end itself, and the normal was off by 5e-4.
  PairWorld world;
  world.add_pair(Capsule{0.6713236570358276f, 0.9499399662017822f},
                 {{2.6218868459004385, 15.378099753078786, 26.570016578940777},
                  {-0.4316575229167938f, 0.8451961874961853f, 0.30844053626060486f, 0.0646495670080185f}},
                 Capsule{0.44155701994895935f, 0.977897584438324f},
                 {{4.154974790060805, 15.226646640031836, 27.659690957366465},
                  {0.7738093733787537f, 0.32812920212745667f, 0.49126163125038147f, -0.22850042581558228f}});
  narrow_phase::NarrowPhase narrow_phase(*world.table);
  const CheckResult result = check_contacts(world, world.pairs, narrow_phase.test(world.bodies, world.pairs), 1e-4);
  INFO(result.text);
  CHECK(result.contacts == 1);
  CHECK(result.wrong == 0);
}
