#include "geometry/vector.hpp"

#include <cmath>
#include <limits>
#include <random>

#include <doctest/doctest.h>

using namespace ringfence;
using namespace ringfence::geometry;

TEST_CASE("a rotation matrix rotates as its quaternion does, and its inverse rotates back") {
  std::mt19937 random(1);
  std::normal_distribution<float> normal;
  for (int i = 0; i < 1000; ++i) {
    const Quat q = normalise({normal(random), normal(random), normal(random), normal(random)});
    const Vec3f p{normal(random), normal(random), normal(random)};
    // The expected result is q p q*, computed in double by cross products.
    const Vec3d u{double{q.x}, double{q.y}, double{q.z}};
    const Vec3d t = cross(u, to_double(p)) * 2.0;
    const Vec3d expected = to_double(p) + t * double{q.w} + cross(u, t);
    CHECK(length(to_double(rotate(rotation(q), p)) - expected) < 1e-5);
    CHECK(length(rotate(rotation_double(q), to_double(p)) - expected) < 1e-12 * (1 + length(expected)) + 1e-6);
    CHECK(length(rotate_inverse(rotation(q), rotate(rotation(q), p)) - p) < 1e-5f);
  }
}

TEST_CASE("normalising changes the length to 1 and keeps the direction") {
  std::mt19937 random(2);
  std::normal_distribution<float> normal;
  for (int i = 0; i < 1000; ++i) {
    const Quat q{normal(random), normal(random), normal(random), normal(random)};
    const Quat unit = normalise(q);
    const double norm = std::sqrt(double{unit.x} * unit.x + double{unit.y} * unit.y + double{unit.z} * unit.z +
                                  double{unit.w} * unit.w);
    CHECK(std::abs(norm - 1) < 2e-7);
    CHECK(double{unit.x} * q.y == doctest::Approx(double{unit.y} * q.x).epsilon(1e-5));
  }
}

TEST_CASE("is_near_unit accepts lengths within a thousandth of 1") {
  CHECK(is_near_unit({0, 0, 0, 1}));
  CHECK(is_near_unit({0, 0, 0, 1.0009f}));
  CHECK(is_near_unit({0, 0, 0, -0.9991f}));
  CHECK_FALSE(is_near_unit({0, 0, 0, 1.002f}));
  CHECK_FALSE(is_near_unit({0, 0, 0, 0}));
  CHECK_FALSE(is_near_unit({0, std::numeric_limits<float>::quiet_NaN(), 0, 1}));
  CHECK_FALSE(is_near_unit({0, std::numeric_limits<float>::infinity(), 0, 1}));
}
