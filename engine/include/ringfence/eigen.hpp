#pragma once

#include <type_traits>

#include <Eigen/Geometry>

#include "ringfence/pose.hpp"

/// Conversions between the plain structs of the API and Eigen's types.
///
/// The only public header that includes Eigen (3.4): code that includes it links Eigen3::Eigen or has Eigen on its
/// include path. The functions check and normalise nothing. They are pure and may be called from any thread.
namespace ringfence {

inline Eigen::Vector3d to_eigen(const Vec3d& vector) noexcept { return {vector.x, vector.y, vector.z}; }
inline Eigen::Vector3f to_eigen(const Vec3f& vector) noexcept { return {vector.x, vector.y, vector.z}; }

/// Component order: Ringfence stores x y z w; Eigen's constructor takes w first.
inline Eigen::Quaternionf to_eigen(const Quat& quat) noexcept { return {quat.w, quat.x, quat.y, quat.z}; }

/// The transform from the shape's axes to the world. The orientation should have unit length.
inline Eigen::Isometry3d to_eigen(const Pose& pose) noexcept {
  Eigen::Isometry3d transform = Eigen::Isometry3d::Identity();
  transform.linear() = to_eigen(pose.orientation).cast<double>().toRotationMatrix();
  transform.translation() = to_eigen(pose.position);
  return transform;
}

/// Converts a vector expression of three doubles to Vec3d, of three floats to Vec3f.
template <typename Derived>
auto from_eigen(const Eigen::MatrixBase<Derived>& expression) noexcept {
  using Scalar = typename Derived::Scalar;
  static_assert(std::is_same_v<Scalar, double> || std::is_same_v<Scalar, float>, "three doubles or three floats");
  const Eigen::Matrix<Scalar, 3, 1> vector = expression;
  return std::conditional_t<std::is_same_v<Scalar, double>, Vec3d, Vec3f>{vector.x(), vector.y(), vector.z()};
}

inline Quat from_eigen(const Eigen::Quaternionf& quat) noexcept { return {quat.x(), quat.y(), quat.z(), quat.w()}; }

/// Position and orientation of a rigid transform. Precondition: its linear part is a rotation.
inline Pose from_eigen(const Eigen::Isometry3d& transform) noexcept {
  const Eigen::Vector3d position = transform.translation();
  const Eigen::Quaternionf orientation = Eigen::Quaterniond(transform.linear()).cast<float>();
  return {from_eigen(position), from_eigen(orientation)};
}

}  // namespace ringfence
