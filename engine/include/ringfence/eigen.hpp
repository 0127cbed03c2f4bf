#pragma once

#include <type_traits>

#include <Eigen/Geometry>

#include "ringfence/pose.hpp"

/// Conversions between the plain structs of the API and Eigen's types.
///
/// The only public header that includes Eigen (3.4): whoever includes it links Eigen3::Eigen or has Eigen on the
/// include path. Nothing is checked or normalised; values pass as they are. Pure functions, callable from any thread.
namespace ringfence {

inline Eigen::Vector3d to_eigen(const Vec3d& vector) noexcept { return {vector.x, vector.y, vector.z}; }
inline Eigen::Vector3f to_eigen(const Vec3f& vector) noexcept { return {vector.x, vector.y, vector.z}; }

/// Mind the order: ours is x y z w everywhere, Eigen's constructor takes w first.
inline Eigen::Quaternionf to_eigen(const Quat& quat) noexcept { return {quat.w, quat.x, quat.y, quat.z}; }

/// The transform that takes a point of the shape's axes to the world. The orientation should be of unit length.
inline Eigen::Isometry3d to_eigen(const Pose& pose) noexcept {
  Eigen::Isometry3d transform = Eigen::Isometry3d::Identity();
  transform.linear() = to_eigen(pose.orientation).cast<double>().toRotationMatrix();
  transform.translation() = to_eigen(pose.position);
  return transform;
}

/// A vector, or any expression that gives one, of three doubles (Vec3d) or three floats (Vec3f).
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
