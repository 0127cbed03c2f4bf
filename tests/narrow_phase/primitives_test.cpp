#include <doctest/doctest.h>

#include "narrow_phase/narrow_phase.hpp"
#include "narrow_phase/pair_world.hpp"

using namespace ringfence;
using namespace ringfence::narrow_phase_test;

namespace {

constexpr ShapeKind primitives[] = {ShapeKind::sphere, ShapeKind::box, ShapeKind::capsule};

/// Every ordered pair of primitive kinds: flipped ones, too.
template <class Check>
void for_each_kinds(const Check& check) {
  for (const ShapeKind p : primitives) {
    for (const ShapeKind q : primitives) check(p, q);
  }
}

void check_right(const PairWorld& world, ShapeKind p, ShapeKind q, std::uint64_t seed, double relative) {
  narrow_phase::NarrowPhase narrow_phase(*world.table);
  const Verdict verdict = judge(world, world.pairs, narrow_phase.test(world.bodies, world.pairs), relative);
  INFO(name_of(p), " ", name_of(q), ", seed ", seed, ": ", verdict.wrong, " of ", world.pairs.size(), " wrong\n",
       verdict.text);
  CHECK(verdict.wrong == 0);
  CHECK(verdict.contacts * 5 > world.pairs.size());
  CHECK(narrow_phase.untested() == 0);
}

}  // namespace

TEST_CASE("contacts of ordinary pairs are the reference's within a hundred-thousandth of the size") {
  for_each_kinds([](ShapeKind p, ShapeKind q) {
    const std::uint64_t seed = 1;
    check_right(ordinary_pairs(p, q, 8000, seed), p, q, seed, 1e-5);
  });
}

TEST_CASE("contacts a million metres from the origin are as right as the positions are") {
  for_each_kinds([](ShapeKind p, ShapeKind q) {
    const std::uint64_t seed = 2;
    check_right(ordinary_pairs(p, q, 1000, seed, {1e6, -1e6, 1e6}), p, q, seed, 1e-5);
  });
}

TEST_CASE("contacts of pairs made to be hard are right") {
  for_each_kinds([](ShapeKind p, ShapeKind q) {
    const std::uint64_t seed = 3;
    check_right(nasty_pairs(p, q, 8000, seed), p, q, seed, 1e-4);
  });
}
