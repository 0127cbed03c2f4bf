#include <algorithm>
#include <cmath>
#include <limits>
#include <random>
#include <vector>

#include <doctest/doctest.h>

#include "geometry/bounds.hpp"
#include "geometry/every_target.hpp"
#include "geometry/shape_table.hpp"
#include "ringfence/pose.hpp"

using namespace ringfence;
using namespace ringfence::geometry;

namespace {

// A coordinate at any order of magnitude from 10^-3 to 10^15, on either side of 0.
double anywhere(std::mt19937_64& random) {
  const double size = std::pow(10.0, std::uniform_real_distribution<double>(-3, 15)(random));
  return random() % 2 == 0 ? size : -size;
}

std::uint32_t step_of(const FixedSpace& space, double x) {
  std::uint32_t point[3];
  space.point({x, 0, 0}, point);
  return point[0];
}

}  // namespace

TEST_CASE("outside the bounds fixed point is monotone too, and boxes that touch have bounds that touch") {
  std::mt19937_64 random(1);
  for (const double side : {1.0, 100.0, 1e7}) {
    const FixedSpace space({-side, 0, 0}, {side, 1, 1}, Outside::has_octaves);
    std::vector<double> places;
    for (int i = 0; i < 100000; ++i) places.push_back(anywhere(random));
    std::sort(places.begin(), places.end());
    for (std::size_t i = 1; i < places.size(); ++i) {
      REQUIRE(step_of(space, places[i - 1]) <= step_of(space, places[i]));
      const double middle = places[i], reach = std::abs(anywhere(random));
      const Bounds left = space.bounds({middle - reach, 0, 0}, {middle, 0, 0});
      const Bounds right = space.bounds({middle, 0, 0}, {middle + reach, 0, 0});
      REQUIRE(touch(left, right));
      std::uint32_t point[3];
      space.point({middle, 0, 0}, point);
      REQUIRE(contains(left, point));
      REQUIRE(contains(right, point));
    }
  }
}

TEST_CASE("a step outside the bounds is at most 2^-18 of the distance from them plus one side") {
  std::mt19937_64 random(2);
  for (const double side : {1.0, 100.0, 1e7}) {
    const FixedSpace space({0, 0, 0}, {side, side, side}, Outside::has_octaves);
    for (int i = 0; i < 100000; ++i) {
      const double x = anywhere(random);
      const double distance = std::max({0.0, -x, x - side});
      const double step = 0x1p-18 * (distance + side);
      REQUIRE(step_of(space, x - step) < step_of(space, x));
      REQUIRE(step_of(space, x) < step_of(space, x + step));
    }
  }
}

TEST_CASE("an object at the farthest coordinate leaves the steps within the bounds as they are") {
  const FixedSpace space({0, 0, 0}, {100, 100, 100}, Outside::has_octaves);
  CHECK(space.min() == Vec3d{0, 0, 0});
  CHECK(space.scale().x == doctest::Approx(4294967296.0 / 100 * 63 / 64));
  CHECK(std::abs(static_cast<double>(step_of(space, 50)) - 0x1p31) <= 1);
  CHECK(step_of(space, -farthest_coordinate) > 0);
  CHECK(step_of(space, farthest_coordinate) < 0xffffffffu);
  CHECK(step_of(space, -std::numeric_limits<double>::max()) == 0);
}

TEST_CASE("with every vector width, solid shapes have the bounds of FixedSpace::bounds, inside, outside and across") {
  test::on_every_target([] {
    std::mt19937_64 random(3);
    ShapeTable shapes;
    const ShapeNumber ball = shapes.add(Sphere{1.5f});
    const FixedSpace space({-40, -40, -40}, {40, 40, 40}, Outside::has_octaves);
    std::uniform_real_distribution<double> near(-45, 45);
    for (int i = 0; i < 20000; ++i) {
      const auto place = [&] { return random() % 2 == 0 ? near(random) : anywhere(random); };
      const Pose pose{{place(), place(), place()}, {}};
      const PlacedShape placed{&pose, ball};
      Bounds bounds;
      FixedPoint point;
      shapes.bounds({&placed, 1}, space, &bounds, &point);
      const double radius = 1.5 + 0x1p-20 * 1.5;
      const Vec3d& p = pose.position;
      const Bounds expected =
          space.bounds({p.x - radius, p.y - radius, p.z - radius}, {p.x + radius, p.y + radius, p.z + radius});
      std::uint32_t at[3];
      space.point(p, at);
      for (int axis = 0; axis < 3; ++axis) {
        REQUIRE(point.at[axis] == at[axis]);
        // The two sums round differently.
        REQUIRE(std::abs(double(bounds.lower[axis]) - double(expected.lower[axis])) <= 1);
        REQUIRE(std::abs(double(bounds.upper[axis]) - double(expected.upper[axis])) <= 1);
      }
      REQUIRE(point.at[3] == 0);
    }
  });
}
