#include "narrow_phase/support/cutting_planes.hpp"

#include <algorithm>
#include <array>
#include <vector>

#include <doctest/doctest.h>

#include "geometry/vector.hpp"
#include "narrow_phase/pair_world.hpp"

namespace ringfence::narrow_phase_test {
namespace {

using narrow_phase::CuttingPlanes;

constexpr Vec3d n{0, 0, 1}, u{1, 0, 0}, v{0, 1, 0};

double highest(const std::vector<Vec3d>& points, const Vec3d& direction) {
  double height = -1e300;
  for (const Vec3d& p : points) height = std::max(height, dot(p, direction));
  return height;
}

TEST_CASE("no direction within the bounds has a lower maximum than the result") {
  for (const std::uint64_t seed : {1u, 2u, 3u, 4u}) {
    CAPTURE(seed);
    RandomSource random(seed);
    for (int round = 0; round < 200; ++round) {
      const double most = random.logarithmic(1e-3, 1);
      const int count = 1 + random.below(8);
      CuttingPlanes planes;
      std::vector<Vec3d> points;
      for (int i = 0; i < count; ++i) {
        points.push_back(random.below(4) == 0 && i > 0 ? points[0] : random.vector(0, 2));
        planes.add(points.back());
      }
      const Vec3d found = planes.lowest(n, u, v, most);
      REQUIRE(found.z == 1);
      REQUIRE(std::max(std::abs(found.x), std::abs(found.y)) <= most);
      const double least = highest(points, found);
      for (int i = -20; i <= 20; ++i) {
        for (int j = -20; j <= 20; ++j) {
          REQUIRE(least <= highest(points, {most * i / 20, most * j / 20, 1}) + 1e-12);
        }
      }
    }
  }
}

TEST_CASE("a ninth support point replaces the oldest one") {
  CuttingPlanes planes;
  planes.add({1000, 0, 0});
  for (int i = 0; i < 8; ++i) planes.add({-1, 0, 1});
  CHECK(planes.lowest(n, u, v, 0.5).x == 0.5);
}

TEST_CASE("without support points the direction does not change") {
  const Vec3d found = CuttingPlanes().lowest(n, u, v, 0.5);
  CHECK(found.x == 0);
  CHECK(found.y == 0);
  CHECK(found.z == 1);
}

}  // namespace
}  // namespace ringfence::narrow_phase_test
