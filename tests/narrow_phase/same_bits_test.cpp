#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <cstring>
#include <new>
#include <random>
#include <vector>

#include <doctest/doctest.h>

#include "narrow_phase/convex_world.hpp"
#include "narrow_phase/narrow_phase.hpp"
#include "narrow_phase/pair_world.hpp"
#include "narrow_phase/targets.hpp"

using namespace ringfence;
using namespace ringfence::narrow_phase_test;
using narrow_phase::NarrowPhase;
using narrow_phase::PairContact;

namespace {

constexpr ShapeKind kinds[] = {ShapeKind::sphere, ShapeKind::box, ShapeKind::capsule, ShapeKind::hull};

/// All kinds of pairs in one world, ordinary and degenerate, in a mixed order.
struct MixedWorld {
  explicit MixedWorld(std::uint64_t seed) {
    for (const ShapeKind p : kinds) {
      for (const ShapeKind q : kinds) {
        worlds.push_back(ordinary_pairs(p, q, 300, seed, {1e5, 2, 3}));
        if (p != ShapeKind::hull && q != ShapeKind::hull) {
          worlds.push_back(degenerate_pairs(p, q, 300, seed, {-7, 1e6, 0}));
        }
      }
    }
    for (PairWorld& world : worlds) {
      const auto shift = static_cast<ShapeNumber>(shapes.size());
      const auto offset = static_cast<std::uint32_t>(bodies.size());
      for (ShapeNumber s = 0; s < world.shapes().size(); ++s) shapes.add(world.shapes().description(s));
      for (narrow_phase::Body body : world.bodies) {
        body.shape += shift;
        bodies.push_back(body);
      }
      for (const geometry::CandidatePair& pair : world.pairs) pairs.push_back({pair.a + offset, pair.b + offset});
    }
    std::shuffle(pairs.begin(), pairs.end(), std::mt19937_64(seed));
  }

  std::vector<PairWorld> worlds;
  geometry::ShapeTable shapes;
  std::vector<narrow_phase::Body> bodies;
  std::vector<geometry::CandidatePair> pairs;
};

std::vector<PairContact> sorted(std::span<const PairContact> contacts) {
  std::vector<PairContact> out(contacts.begin(), contacts.end());
  std::sort(out.begin(), out.end(), [](const PairContact& p, const PairContact& q) { return p.pair < q.pair; });
  return out;
}

bool same_bits(std::span<const PairContact> p, std::span<const PairContact> q) {
  return p.size() == q.size() && std::memcmp(p.data(), q.data(), p.size_bytes()) == 0;
}

bool same_but_pair(const PairContact& p, const PairContact& q) {
  return std::memcmp(&p.depth, &q.depth, sizeof(PairContact) - sizeof(p.pair)) == 0;
}

/// Restores the choice of target, also when a check fails.
struct ForcedTarget {
  explicit ForcedTarget(const std::string& name) { narrow_phase::force_target(name); }
  ~ForcedTarget() { narrow_phase::force_target(""); }
};

}  // namespace

TEST_CASE("every target that the machine supports gives the same bits") {
  const std::uint64_t seed = 11;
  INFO("seed ", seed);
  const MixedWorld world(seed);
  NarrowPhase narrow_phase(world.shapes);
  const std::vector<PairContact> expected = sorted(narrow_phase.test(world.bodies, world.pairs));
  REQUIRE(expected.size() * 5 > world.pairs.size());
  const std::vector<std::string> targets = narrow_phase::targets();
  REQUIRE(!targets.empty());
  for (const std::string& target : targets) {
    INFO("target ", target);
    const ForcedTarget forced(target);
    CHECK(same_bits(sorted(narrow_phase.test(world.bodies, world.pairs)), expected));
  }
}

// Such pairs have more edges that cannot be excluded than a block has room for.
TEST_CASE("hulls of many points that overlap deeply have the same bits on every target, in any batch") {
  const std::uint64_t seed = 15;
  INFO("seed ", seed);
  RandomSource random(seed);
  PairWorld world;
  for (int i = 0; i < 240; ++i) {
    ConvexHull hulls[2];
    for (ConvexHull& hull : hulls) {
      const float flatness = i % 4 == 0 ? 0.02f : 1.0f;
      for (int points = 40 + random.below(210); points > 0; --points) {
        const Vec3d at = random.direction();
        hull.points.push_back(
            {static_cast<float>(at.x), static_cast<float>(at.y), flatness * static_cast<float>(at.z)});
      }
    }
    const double apart = i % 3 == 0 ? 0 : random.uniform(0, 1.9);
    world.add_pair(hulls[0], {{0, 0, 0}, random.orientation()}, hulls[1], {random.vector(apart), random.orientation()});
  }
  NarrowPhase narrow_phase(world.shapes());
  const std::vector<PairContact> expected = sorted(narrow_phase.test(world.bodies, world.pairs));
  REQUIRE(expected.size() > world.pairs.size() / 2);
  for (const std::string& target : narrow_phase::targets()) {
    INFO("target ", target);
    const ForcedTarget forced(target);
    std::vector<PairContact> pieces;
    for (std::size_t begin = 0, size = 1; begin < world.pairs.size(); begin += size, size = 1 + size * 2 % 37) {
      const auto batch = std::span(world.pairs).subspan(begin, std::min(size, world.pairs.size() - begin));
      for (PairContact contact : narrow_phase.test(world.bodies, batch)) {
        contact.pair += static_cast<std::uint32_t>(begin);
        pieces.push_back(contact);
      }
    }
    CHECK(same_bits(sorted(pieces), expected));
  }
}

// The last target is plain C++ (scalar; emu128 with clang++). The scalar target selects faces and edges by bounds in
// float, the others by bounds in fixed point.
TEST_CASE("needles, plates, grids, prisms and hulls far from their origin have the bits of plain C++") {
  for (std::uint64_t seed = 16; seed < 22; ++seed) {
    INFO("seed ", seed);
    const PairWorld world = degenerate_convex_pairs(ShapeKind::hull, ShapeKind::hull, 1500, seed);
    NarrowPhase narrow_phase(world.shapes());
    const auto contacts_on = [&](const std::string& target) {
      const ForcedTarget forced(target);
      return sorted(narrow_phase.test(world.bodies, world.pairs));
    };
    const std::vector<PairContact> expected = contacts_on(narrow_phase::targets().back());
    REQUIRE(expected.size() > world.pairs.size() / 8);
    for (const std::string& target : narrow_phase::targets()) {
      INFO("target ", target);
      CHECK(same_bits(contacts_on(target), expected));
    }
  }
}

TEST_CASE("an unknown target is refused and does not change the selected target") {
  CHECK_THROWS(narrow_phase::force_target("abacus"));
  CHECK(!narrow_phase::targets().empty());
}

TEST_CASE("the result of a pair does not depend on the other pairs") {
  const std::uint64_t seed = 12;
  INFO("seed ", seed);
  const MixedWorld world(seed);
  NarrowPhase narrow_phase(world.shapes);
  const std::vector<PairContact> all = sorted(narrow_phase.test(world.bodies, world.pairs));

  SUBCASE("in another order") {
    std::vector<std::uint32_t> order(world.pairs.size());
    for (std::uint32_t i = 0; i < order.size(); ++i) order[i] = i;
    std::shuffle(order.begin(), order.end(), std::mt19937_64(seed + 1));
    std::vector<geometry::CandidatePair> shuffled;
    for (const std::uint32_t i : order) shuffled.push_back(world.pairs[i]);
    const std::span<const PairContact> found = narrow_phase.test(world.bodies, shuffled);
    std::vector<PairContact> back(found.begin(), found.end());
    for (PairContact& contact : back) contact.pair = order[contact.pair];
    CHECK(same_bits(sorted(back), all));
  }
  SUBCASE("in batches of every small size") {
    std::mt19937_64 random(seed + 2);
    std::vector<PairContact> pieces;
    std::size_t begin = 0;
    while (begin < world.pairs.size()) {
      const std::size_t size = std::min<std::size_t>(1 + random() % 40, world.pairs.size() - begin);
      for (PairContact contact : narrow_phase.test(world.bodies, std::span(world.pairs).subspan(begin, size))) {
        contact.pair += static_cast<std::uint32_t>(begin);
        pieces.push_back(contact);
      }
      begin += size;
    }
    CHECK(same_bits(sorted(pieces), all));
  }
  SUBCASE("alone") {
    std::size_t next = 0, different = 0;
    for (std::size_t i = 0; i < world.pairs.size(); ++i) {
      const std::span<const PairContact> one = narrow_phase.test(world.bodies, {&world.pairs[i], 1});
      const bool hit = next < all.size() && all[next].pair == i;
      if (hit != (one.size() == 1)) {
        ++different;
      } else if (hit && !same_but_pair(one[0], all[next])) {
        ++different;
      }
      next += hit;
    }
    CHECK(different == 0);
  }
}

// Pairs of such a world are not sorted, and the kernels of closed forms read them where they are.
TEST_CASE("a world of one kind has the contacts that its pairs have in a mixed world, on every target") {
  const std::uint64_t seed = 16;
  INFO("seed ", seed);
  for (const ShapeKind kind : kinds) {
    INFO("kind ", static_cast<int>(kind));
    const PairWorld world = ordinary_pairs(kind, kind, 700, seed);
    geometry::ShapeTable mixed;
    for (ShapeNumber s = 0; s < world.shapes().size(); ++s) mixed.add(world.shapes().description(s));
    mixed.add(kind == ShapeKind::sphere ? ShapeDescription(Box{{1, 1, 1}}) : ShapeDescription(Sphere{1}));
    for (const std::string& target : narrow_phase::targets()) {
      INFO("target ", target);
      const ForcedTarget forced(target);
      NarrowPhase expects(mixed), narrow_phase(world.shapes());
      const std::span<const PairContact> expected = expects.test(world.bodies, world.pairs);
      REQUIRE(expected.size() > 100);
      REQUIRE(expected.size() < 600);
      // Twenty rounds are enough for blocks of pairs to be timed, which are gathered in another way.
      std::size_t different = 0;
      for (int round = 0; round < 20; ++round) {
        different += !same_bits(narrow_phase.test(world.bodies, world.pairs), expected);
      }
      CHECK(different == 0);
      CHECK(narrow_phase.counters(kind, kind).timed > 0);
      for (std::size_t size = 1; size < 80; ++size) {
        const auto some = std::span(world.pairs).first(size);
        different += !same_bits(narrow_phase.test(world.bodies, some), expects.test(world.bodies, some));
      }
      CHECK(different == 0);
    }
  }
}

// Kernels of boxes list the pairs that may touch before they test them, but neither the last pairs of a list nor those
// after many that touch.
TEST_CASE("a pair of boxes has the same contact alone as after pairs that touch, or that do not, on every target") {
  const std::uint64_t seed = 17;
  INFO("seed ", seed);
  struct Kinds {
    ShapeKind first, second;
  };
  for (const Kinds both : {Kinds{ShapeKind::box, ShapeKind::box}, Kinds{ShapeKind::box, ShapeKind::capsule},
                           Kinds{ShapeKind::capsule, ShapeKind::box}}) {
    const ShapeKind p = both.first, q = both.second;
    INFO("kinds ", name_of(p), " and ", name_of(q));
    PairWorld world = ordinary_pairs(p, q, 4000, seed);
    NarrowPhase narrow_phase(world.shapes());
    std::vector<bool> hit(world.pairs.size());
    for (const PairContact& contact : narrow_phase.test(world.bodies, world.pairs)) {
      hit[contact.pair] = true;
      // Every other pair is moved until it just touches, or just does not.
      if (contact.pair % 2 == 0) continue;
      const float apart = contact.depth + static_cast<float>(static_cast<int>(contact.pair % 14) - 7) * 5e-8f;
      Vec3d& position = world.bodies[world.pairs[contact.pair].b].pose.position;
      position.x += static_cast<double>(contact.normal.x * apart);
      position.y += static_cast<double>(contact.normal.y * apart);
      position.z += static_cast<double>(contact.normal.z * apart);
    }
    std::vector<geometry::CandidatePair> pairs;
    for (const bool touches : {true, false, true}) {
      for (std::size_t i = 0; i < world.pairs.size(); ++i) {
        if (hit[i] == touches) pairs.push_back(world.pairs[i]);
      }
    }
    pairs.insert(pairs.end(), world.pairs.begin(), world.pairs.end());
    for (const std::string& target : narrow_phase::targets()) {
      INFO("target ", target);
      const ForcedTarget forced(target);
      std::vector<PairContact> alone;
      for (std::uint32_t i = 0; i < pairs.size(); ++i) {
        for (PairContact contact : narrow_phase.test(world.bodies, {&pairs[i], 1})) {
          contact.pair = i;
          alone.push_back(contact);
        }
      }
      CHECK(alone.size() > pairs.size() / 5);
      CHECK(alone.size() < pairs.size() * 4 / 5);
      CHECK(same_bits(narrow_phase.test(world.bodies, pairs), alone));
    }
  }
}

TEST_CASE("a world shifted by whole powers of two has the same contacts") {
  const std::uint64_t seed = 13;
  INFO("seed ", seed);
  MixedWorld world(seed);
  NarrowPhase narrow_phase(world.shapes);
  // Coarse enough that the shift does not add rounding.
  const double grain = std::ldexp(1.0, -20);
  for (narrow_phase::Body& body : world.bodies) {
    Vec3d& p = body.pose.position;
    p = {std::floor(p.x / grain) * grain, std::floor(p.y / grain) * grain, std::floor(p.z / grain) * grain};
  }
  const std::vector<PairContact> here = sorted(narrow_phase.test(world.bodies, world.pairs));
  for (narrow_phase::Body& body : world.bodies) {
    body.pose.position.x += 1048576.0;
    body.pose.position.z -= 524288.0;
  }
  CHECK(same_bits(sorted(narrow_phase.test(world.bodies, world.pairs)), here));
}

TEST_CASE("swapping a and b mirrors the contact") {
  for (const ShapeKind p : kinds) {
    for (const ShapeKind q : kinds) {
      const std::uint64_t seed = 14;
      INFO(name_of(p), " ", name_of(q), ", seed ", seed);
      const PairWorld world = ordinary_pairs(p, q, 2000, seed);
      NarrowPhase narrow_phase(world.shapes());
      const std::vector<PairContact> one = sorted(narrow_phase.test(world.bodies, world.pairs));
      const std::vector<PairContact> other = sorted(narrow_phase.test(world.bodies, world.swapped()));
      REQUIRE(one.size() == other.size());
      std::size_t turned = 0;
      for (std::size_t i = 0; i < one.size(); ++i) {
        REQUIRE(one[i].pair == other[i].pair);
        CHECK(std::abs(one[i].depth - other[i].depth) < 4e-6f);
        // Two axes may be equally good within rounding. Then the normals may differ, but only rarely.
        const float cosine = -(one[i].normal.x * other[i].normal.x + one[i].normal.y * other[i].normal.y +
                               one[i].normal.z * other[i].normal.z);
        turned += cosine < 0.9999f;
      }
      CHECK(turned * 500 < one.size());
    }
  }
}
