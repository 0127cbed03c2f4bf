#include "ringfence/eigen.hpp"

#include <cmath>

#include <doctest/doctest.h>

using namespace ringfence;

TEST_CASE("conversions to Eigen and back keep vectors and quaternions unchanged") {
  const Vec3d position{1e6 + 0.1, -2, 3};
  const Vec3f extent{0.1f, -2, 3};
  const Quat orientation{0.1f, -0.5f, 0.7f, 0.5f};  // conversions do not normalise
  CHECK(from_eigen(to_eigen(position)) == position);
  CHECK(from_eigen(to_eigen(extent)) == extent);
  CHECK(from_eigen(to_eigen(orientation)) == orientation);
}

TEST_CASE("an Eigen expression converts like its value") {
  const Eigen::Vector3d a(1, 2, 3);
  const Vec3d sum = from_eigen(a + 2 * Eigen::Vector3d::UnitX());
  CHECK(sum == Vec3d{3, 2, 3});
}

TEST_CASE("a pose converts to the transform from shape coordinates to world coordinates") {
  const float half = std::sqrt(0.5f);
  const Pose quarter_turn{{10, 20, 30}, {0, 0, half, half}};  // about z
  const Eigen::Vector3d x_axis_tip = to_eigen(quarter_turn) * Eigen::Vector3d::UnitX();
  CHECK((x_axis_tip - Eigen::Vector3d(10, 21, 30)).norm() < 1e-6);
}

TEST_CASE("conversion to a transform and back keeps a pose, up to the sign of its quaternion") {
  Eigen::Quaternionf rotation(0.3f, -0.4f, 0.5f, 0.6f);
  rotation.normalize();
  const Pose pose{{1e6, -3, 0.25}, from_eigen(rotation)};
  const Pose back = from_eigen(to_eigen(pose));
  CHECK(back.position == pose.position);
  CHECK(std::abs(to_eigen(back.orientation).dot(rotation)) > 1 - 1e-6f);
}
