#include "geometry/bounds.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <random>
#include <vector>

#include <doctest/doctest.h>

#include "geometry/vector.hpp"
#include "ringfence/error.hpp"

using namespace ringfence;
using namespace ringfence::geometry;

TEST_CASE("bounds round outwards, positions down, by at most one step") {
  std::mt19937_64 random(1);
  for (const double side : {1.0, 100.0, 1e4, 1e7}) {
    const FixedSpace space({-side, 0, -side / 3}, {side, side, side / 3});
    std::uniform_real_distribution<double> unit(0.01, 0.99);
    for (int i = 0; i < 20000; ++i) {
      const auto inside = [&](double low, double high) { return low + unit(random) * (high - low); };
      const Vec3d p{inside(-side, side), inside(0, side), inside(-side / 3, side / 3)};
      const Vec3d q{std::min(side * 0.999, p.x + unit(random)), p.y, p.z};
      const Bounds bounds = space.bounds(p, q);
      const long double at = (static_cast<long double>(p.x) + side) * space.scale().x;
      const long double to = (static_cast<long double>(q.x) + side) * space.scale().x;
      // The product has a rounding error in double of up to 2^-20 steps.
      REQUIRE(bounds.lower[0] <= at + 1e-5L);
      REQUIRE(bounds.lower[0] >= at - 1.00001L);
      REQUIRE(bounds.upper[0] >= to - 1e-5L);
      REQUIRE(bounds.upper[0] <= to + 1.00001L);
      std::uint32_t cell[3];
      space.point(p, cell);
      REQUIRE(cell[0] == bounds.lower[0]);
      REQUIRE(cell[1] == bounds.lower[1]);
    }
  }
}

TEST_CASE("fixed point is monotone: boxes that touch have bounds that touch") {
  std::mt19937_64 random(2);
  std::uniform_real_distribution<double> far(-2e7, 2e7), small(0, 1e-9);
  const FixedSpace space({-1e7, -1e7, -1e7}, {1e7, 1e7, 1e7});
  for (int i = 0; i < 200000; ++i) {
    const double x = far(random), y = x + small(random);
    const Bounds left = space.bounds({x - 1, 0, 0}, {y, 0, 0}), right = space.bounds({x, 0, 0}, {x + 1, 0, 0});
    REQUIRE(touch(left, right));
    std::uint32_t p[3], q[3];
    space.point({x, 0, 0}, p);
    space.point({y, 0, 0}, q);
    REQUIRE(p[0] <= q[0]);
  }
}

TEST_CASE("coordinates outside the world saturate at its faces") {
  const FixedSpace space({0, 0, 0}, {100, 100, 40});
  const double huge = std::numeric_limits<double>::max();
  const Bounds bounds = space.bounds({-huge, -1, 41}, {-5, huge, huge});
  CHECK(bounds == Bounds{{0, 0, 0xffffffffu}, {0, 0xffffffffu, 0xffffffffu}});
  std::uint32_t cell[3];
  space.point({-1e300, 100, 20}, cell);
  CHECK(cell[0] == 0);
  CHECK(cell[1] == 0xffffffffu);
  CHECK(cell[2] == 0x80000000u);
}

TEST_CASE("invalid world bounds are refused, and thin ones are widened") {
  const double nan = std::numeric_limits<double>::quiet_NaN(), inf = std::numeric_limits<double>::infinity();
  CHECK_THROWS_AS(FixedSpace({0, 0, 0}, {1, nan, 1}), Error);
  CHECK_THROWS_AS(FixedSpace({0, 0, 0}, {1, 1, inf}), Error);
  CHECK_THROWS_AS(FixedSpace({-1e308, 0, 0}, {1e308, 1, 1}), Error);
  CHECK_THROWS_AS(FixedSpace({2, 0, 0}, {1, 1, 1}), Error);
  const FixedSpace space({0, 5, 0}, {10, 5, 0.25});
  CHECK(space.max() == Vec3d{10, 6, 1});
}
