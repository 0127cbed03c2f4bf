#include "ringfence/eigen.hpp"

#include <cmath>

#include <doctest/doctest.h>

using namespace ringfence;

TEST_CASE("vectors and quaternions pass through Eigen unchanged") {
  const Vec3d position{1e6 + 0.1, -2, 3};
  const Vec3f extent{0.1f, -2, 3};
  const Quat orientation{0.1f, -0.5f, 0.7f, 0.5f};  // conversions do not normalise
  CHECK(from_eigen(to_eigen(position)) == position);
  CHECK(from_eigen(to_eigen(extent)) == extent);
  CHECK(from_eigen(to_eigen(orientation)) == orientation);
}

TEST_CASE("an expression converts as the vector that it gives") {
  const Eigen::Vector3d a(1, 2, 3);
  const Vec3d sum = from_eigen(a + 2 * Eigen::Vector3d::UnitX());
  CHECK(sum == Vec3d{3, 2, 3});
}

TEST_CASE("a pose becomes the transform from the shape's axes to the world") {
  const float half = std::sqrt(0.5f);
  const Pose quarter_turn{{10, 20, 30}, {0, 0, half, half}};  // about z
  const Eigen::Vector3d x_axis_tip = to_eigen(quarter_turn) * Eigen::Vector3d::UnitX();
  CHECK((x_axis_tip - Eigen::Vector3d(10, 21, 30)).norm() < 1e-6);
}

TEST_CASE("a pose survives the way through a transform, up to the sign of its quaternion") {
  Eigen::Quaternionf turn(0.3f, -0.4f, 0.5f, 0.6f);
  turn.normalize();
  const Pose pose{{1e6, -3, 0.25}, from_eigen(turn)};
  const Pose back = from_eigen(to_eigen(pose));
  CHECK(back.position == pose.position);
  CHECK(std::abs(to_eigen(back.orientation).dot(turn)) > 1 - 1e-6f);
}
