#include "queries/interpolate.hpp"

#include <algorithm>
#include <cmath>

#include <doctest/doctest.h>

#include "geometry/vector.hpp"
#include "queries/random_rows.hpp"

namespace ringfence::queries_test {
namespace {

using queries::interpolate;

double norm(const Quat& q) {
  const double x = q.x, y = q.y, z = q.z, w = q.w;
  return std::sqrt(x * x + y * y + z * z + w * w);
}

Vec3d place(const Pose& pose, const Vec3d& point) {
  const Quat& q = pose.orientation;
  const auto r = geometry::rotation<double>(q.x, q.y, q.z, q.w);
  const auto row = [&](int i) { return r.m[i][0] * point.x + r.m[i][1] * point.y + r.m[i][2] * point.z; };
  return pose.position + Vec3d{row(0), row(1), row(2)};
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

TEST_CASE("no point bulges more from the straight line between its ends than the bound says") {
  Random random(3);
  double tightest = 0;
  for (int i = 0; i < 3000; ++i) {
    const Pose from{random.in_cube(10), random.orientation()};
    Pose to{random.in_cube(10), random.orientation()};
    // Often nearly the same orientation.
    if (random.below(2) == 0) to.orientation = interpolate(from, to, random.uniform(0, 0.2)).orientation;
    const Vec3d point = random.in_cube(1);
    const double f = random.uniform(0, 1);
    const Vec3d start = place(from, point), end = place(to, point), there = place(interpolate(from, to, f), point);
    const double bulge = length(there - (start + (end - start) * f));
    const double bound = length(point) * queries::most_bulge(queries::turn_cosine(from.orientation, to.orientation));
    CHECK(bulge <= bound + 2e-6);
    if (bound > 1e-3) tightest = std::max(tightest, bulge / bound);
  }
  CHECK(tightest > 0.5);
  CHECK(queries::most_bulge(1) == 0);
}

}  // namespace
}  // namespace ringfence::queries_test
