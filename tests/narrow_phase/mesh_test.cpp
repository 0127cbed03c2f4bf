#include <algorithm>
#include <cmath>
#include <cstring>
#include <memory>
#include <vector>

#include <doctest/doctest.h>

#include "geometry/ellipsoid.hpp"
#include "geometry/vector.hpp"
#include "narrow_phase/mesh_world.hpp"
#include "narrow_phase/narrow_phase.hpp"
#include "narrow_phase/targets.hpp"
#include "worlds/asteroid.hpp"

using namespace ringfence;
using namespace ringfence::narrow_phase_test;
using narrow_phase::NarrowPhase;
using narrow_phase::PairContact;

namespace {

constexpr ShapeKind kinds[] = {ShapeKind::sphere, ShapeKind::box, ShapeKind::capsule, ShapeKind::hull, ShapeKind::mesh};

void check(const PairWorld& world) {
  NarrowPhase narrow_phase(world.shapes());
  for (const auto& pairs : {world.pairs, world.swapped()}) {
    const std::span<const PairContact> found = narrow_phase.test(world.bodies, pairs);
    const CheckResult result = check_contacts(world, pairs, found);
    CHECK_MESSAGE(result.wrong == 0, result.wrong << " of " << pairs.size() << " wrong:\n" << result.text);
    CHECK(result.contacts > pairs.size() / 8);
    CHECK(result.contacts < pairs.size());
  }
}

std::vector<PairContact> sorted(std::span<const PairContact> contacts) {
  std::vector<PairContact> out(contacts.begin(), contacts.end());
  std::sort(out.begin(), out.end(), [](const PairContact& p, const PairContact& q) { return p.pair < q.pair; });
  return out;
}

bool same_bits(const std::vector<PairContact>& p, const std::vector<PairContact>& q) {
  return p.size() == q.size() && std::memcmp(p.data(), q.data(), p.size() * sizeof(PairContact)) == 0;
}

/// The contacts of two unrotated objects, the second at the given position.
std::vector<PairContact> contacts_of(const ShapeDescription& a, const ShapeDescription& b, Vec3d at) {
  PairWorld world;
  world.add_pair(a, {}, b, {at, {}});
  NarrowPhase narrow_phase(world.shapes());
  const std::span<const PairContact> found = narrow_phase.test(world.bodies, world.pairs);
  return {found.begin(), found.end()};
}

}  // namespace

TEST_CASE("contacts of ordinary pairs with a mesh match the reference, at the origin and far from it") {
  for (const ShapeKind kind : kinds) {
    for (const std::uint64_t seed : {31u, 32u}) {
      INFO(name_of(kind));
      CAPTURE(seed);
      const std::size_t count = kind == ShapeKind::mesh ? 150 : 600;
      check(ordinary_mesh_pairs(kind, count, seed, seed == 31 ? Vec3d{} : Vec3d{1e6, -2e6, 3e5}));
    }
  }
}

TEST_CASE("contacts of needles, coplanar faces, triangle soup, single triangles and size ratios of 1000 are right") {
  for (const ShapeKind kind : kinds) {
    for (const std::uint64_t seed : {33u, 34u}) {
      INFO(name_of(kind));
      CAPTURE(seed);
      const std::size_t count = kind == ShapeKind::mesh ? 250 : 700;
      check(degenerate_mesh_pairs(kind, count, seed, seed == 33 ? Vec3d{} : Vec3d{-1e6, 5e5, 0}));
    }
  }
}

// Level geometry is like this: everything is turned by right angles, but for rounding.
TEST_CASE("crates with edges and faces nearly parallel to those of a mesh have the right contacts") {
  for (const unsigned seed : {1u, 2u, 3u}) {
    CAPTURE(seed);
    RandomSource random(seed);
    PairWorld world;
    const auto half_extents = [&] {
      return Vec3d{random.logarithmic(0.05, 5), random.logarithmic(0.05, 5), random.logarithmic(0.05, 5)};
    };
    for (int i = 0; i < 15'000; ++i) {
      const Vec3d crate = half_extents(), block = half_extents();
      constexpr double quarter = 0.78539816339744831;
      constexpr double turns[] = {0, quarter, 2 * quarter, 0.3};
      const double half = 0.5 * turns[random.below(4)], tilt = random.logarithmic(1e-9, 1e-2);
      // The tilt is added to the quaternion, which is normalised to float.
      Vec3d turn = Vec3d{random.uniform(-1, 1), random.uniform(-1, 1), random.uniform(-1, 1)} * tilt;
      const int axis = random.below(3);
      (axis == 0 ? turn.x : axis == 1 ? turn.y : turn.z) += std::sin(half);
      const double inverse = 1 / std::sqrt(dot(turn, turn) + std::cos(half) * std::cos(half));
      Pose at;
      at.orientation = {static_cast<float>(turn.x * inverse), static_cast<float>(turn.y * inverse),
                        static_cast<float>(turn.z * inverse), static_cast<float>(std::cos(half) * inverse)};
      // Beside a face, an edge or a corner, with a small overlap or gap.
      const double beyond = random.logarithmic(1e-6, 0.3) * (random.below(4) == 0 ? 1 : -1);
      const Vec3d reach = crate + block + Vec3d{beyond, beyond, beyond};
      const int place = random.below(4);
      at.position = place < 2    ? Vec3d{reach.x, random.uniform(-1, 1) * reach.y, random.uniform(-1, 1) * reach.z}
                    : place == 2 ? Vec3d{0.7071 * reach.x, 0.7071 * reach.y, 0}
                                 : reach * 0.577;
      ConvexHull hull;
      for (unsigned corner = 0; corner < 8; ++corner) {
        const auto side = [corner](double extent, unsigned bit) {
          return static_cast<float>((corner & bit) != 0 ? extent : -extent);
        };
        hull.points.push_back({side(crate.x, 1), side(crate.y, 2), side(crate.z, 4)});
      }
      world.add_pair(seed == 3 ? ShapeDescription(Box{to_float(crate)}) : ShapeDescription(hull), {},
                     box_surface(block, 1), at);
    }
    NarrowPhase narrow_phase(world.shapes());
    const CheckResult result = check_contacts(world, world.pairs, narrow_phase.test(world.bodies, world.pairs));
    CHECK(result.contacts > world.pairs.size() / 2);
    CHECK_MESSAGE(result.wrong == 0, result.text);
  }
}

TEST_CASE("every target gives the same bits for meshes") {
  for (const ShapeKind kind : kinds) {
    for (const bool degenerate : {false, true}) {
      INFO(name_of(kind));
      CAPTURE(degenerate);
      const PairWorld world = degenerate ? degenerate_mesh_pairs(kind, 600, 35) : ordinary_mesh_pairs(kind, 600, 35);
      NarrowPhase narrow_phase(world.shapes());
      const std::vector<PairContact> expected = sorted(narrow_phase.test(world.bodies, world.pairs));
      CHECK(expected.size() > 100);
      for (const std::string& target : narrow_phase::targets()) {
        CAPTURE(target);
        narrow_phase::force_target(target);
        CHECK(same_bits(sorted(narrow_phase.test(world.bodies, world.pairs)), expected));
      }
      narrow_phase::force_target("");
    }
  }
}

TEST_CASE("an object inside a closed mesh that does not touch the surface has no contact") {
  const TriangleMesh shell = box_surface({2, 2, 2}, 4);
  CHECK(contacts_of(shell, Sphere{0.5f}, {0.3, 0, 0}).empty());
  CHECK(contacts_of(shell, Box{{1, 1, 1}}, {}).empty());
  CHECK(contacts_of(shell, Capsule{0.5f, 1.0f}, {}).empty());
  CHECK(contacts_of(shell, box_surface({1, 1, 1}, 2), {}).empty());
  const auto from_inside = contacts_of(shell, Sphere{0.5f}, {1.75, 0, 0});
  REQUIRE(from_inside.size() == 1);
  CHECK(from_inside[0].depth == doctest::Approx(0.25));
  CHECK(from_inside[0].normal.x == doctest::Approx(-1));
  CHECK(from_inside[0].point.x == doctest::Approx(2.125));
}

TEST_CASE("of equal contacts the one with the lowest triangle is reported, for every tree") {
  // Every triangle touches the sphere from above at the same depth; the result is the triangle with the lowest number,
  // in both orders.
  TriangleMesh mesh = terrain(16, 8, 0);
  PairWorld world;
  world.add_pair(mesh, {}, Box{{20, 20, 1}}, {{0, 0, 0.5}, {}});
  std::vector<std::uint32_t> turned;
  for (std::size_t i = mesh.indices.size(); i > 0; i -= 3) {
    turned.insert(turned.end(), mesh.indices.begin() + static_cast<std::ptrdiff_t>(i) - 3,
                  mesh.indices.begin() + static_cast<std::ptrdiff_t>(i));
  }
  const auto first_corner = mesh.vertices[mesh.indices[0]], last_corner = mesh.vertices[turned[0]];
  mesh.indices = turned;
  world.add_pair(mesh, {}, Box{{20, 20, 1}}, {{0, 0, 0.5}, {}});
  NarrowPhase narrow_phase(world.shapes());
  const auto found = sorted(narrow_phase.test(world.bodies, world.pairs));
  REQUIRE(found.size() == 2);
  for (std::size_t i = 0; i < 2; ++i) {
    const Vec3f corner = i == 0 ? first_corner : last_corner;
    CHECK(std::abs(found[i].point.x - corner.x) <= 1.01f);
    CHECK(std::abs(found[i].point.y - corner.y) <= 1.01f);
    CHECK(found[i].depth == doctest::Approx(0.5));
  }
}

TEST_CASE("contacts with a mesh of 100,000 triangles are as precise as with a small one") {
  PairWorld world;
  const TriangleMesh asteroid = worlds::make_asteroid(5, 1, 71), other = worlds::make_asteroid(5, 2, 71);
  CHECK(asteroid.indices.size() / 3 == 100'820);
  RandomSource random(36);
  const ShapeNumber numbers[] = {world.table->add(asteroid), world.table->add(other), world.table->add(Sphere{0.4f})};
  for (const ShapeDescription& shape :
       {ShapeDescription(asteroid), ShapeDescription(other), ShapeDescription(Sphere{0.4f})})
    world.reference.add(shape);
  for (std::uint32_t i = 0; i < 24; ++i) {
    world.bodies.push_back({{{}, random.orientation()}, numbers[0], 2 * i + 1});
    const double away = i % 2 == 0 ? random.uniform(1.6, 2.2) : random.uniform(0.5, 1.5);
    world.bodies.push_back({{random.vector(away), random.orientation()}, numbers[i % 2 == 0 ? 1 : 2], 2 * i + 2});
    world.pairs.push_back({2 * i, 2 * i + 1});
  }
  check(world);
}

TEST_CASE("contacts of support shapes with meshes match the reference") {
  PairWorld world = ordinary_mesh_pairs(ShapeKind::sphere, 60, 37);
  RandomSource random(38);
  std::vector<ShapeNumber> ellipsoids;
  for (int i = 0; i < 8; ++i) {
    const auto size = [&] { return static_cast<float>(random.uniform(0.4, 1.2)); };
    const ShapeDescription shape = SupportShape{std::make_shared<test::Ellipsoid>(Vec3f{size(), size(), size()})};
    ellipsoids.push_back(world.table->add(shape));
    world.reference.add(shape);
  }
  for (const geometry::CandidatePair& pair : world.pairs) world.bodies[pair.a].shape = ellipsoids[pair.a % 8];
  NarrowPhase narrow_phase(world.shapes());
  for (const auto& pairs : {world.pairs, world.swapped()}) {
    const CheckResult result = check_contacts(world, pairs, narrow_phase.test(world.bodies, pairs), 1e-3);
    CHECK_MESSAGE(result.wrong == 0, result.wrong << " of " << pairs.size() << " wrong:\n" << result.text);
    CHECK(result.contacts > pairs.size() / 8);
  }
}
