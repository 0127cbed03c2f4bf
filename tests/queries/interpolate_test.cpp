#include <cmath>

#include <doctest/doctest.h>

#include "queries/frame_object.hpp"
#include "queries/random_rows.hpp"

namespace ringfence::queries_test {
namespace {

using queries::interpolate;

double norm(const Quat& q) {
  const double x = q.x, y = q.y, z = q.z, w = q.w;
  return std::sqrt(x * x + y * y + z * z + w * w);
}

TEST_CASE("an interpolated pose is on the straight way, with a unit orientation between the two") {
  Random random(1);
  for (int i = 0; i < 2000; ++i) {
    const Pose from{random.in_cube(1e3), random.orientation()};
    const Pose to{random.in_cube(1e3), random.orientation()};
    const double f = random.uniform(0, 1);
    const Pose pose = interpolate(from, to, f);
    CHECK(pose.position.x == doctest::Approx((1 - f) * from.position.x + f * to.position.x));
    CHECK(pose.position.y == doctest::Approx((1 - f) * from.position.y + f * to.position.y));
    CHECK(pose.position.z == doctest::Approx((1 - f) * from.position.z + f * to.position.z));
    CHECK(norm(pose.orientation) == doctest::Approx(1).epsilon(1e-6));
    // The rotation is nearer to each end than the ends are to each other.
    const auto alike = [](const Quat& p, const Quat& q) {
      return std::abs(double{p.x} * q.x + double{p.y} * q.y + double{p.z} * q.z + double{p.w} * q.w);
    };
    const double ends = alike(from.orientation, to.orientation);
    CHECK(alike(pose.orientation, from.orientation) >= ends - 1e-6);
    CHECK(alike(pose.orientation, to.orientation) >= ends - 1e-6);
    // A quaternion and its negative are the same rotation.
    const Quat& q = to.orientation;
    const Pose other = interpolate(from, {to.position, {-q.x, -q.y, -q.z, -q.w}}, f);
    CHECK(alike(other.orientation, pose.orientation) == doctest::Approx(1).epsilon(1e-6));
  }
}

TEST_CASE("at fraction 0, and of equal poses, the interpolated pose has the same bits") {
  Random random(2);
  const Pose from{random.in_cube(1e3), random.orientation()}, to{random.in_cube(1e3), random.orientation()};
  CHECK(interpolate(from, to, 0) == from);
  CHECK(interpolate(from, from, 0.3) == from);
}

}  // namespace
}  // namespace ringfence::queries_test
