#pragma once

#include <cmath>
#include <limits>

#include "ringfence/pose.hpp"

// Arithmetic on the API's plain vectors and quaternions and on rotation matrices, in float and double. Every formula is
// a fixed sequence of IEEE operations. SIMD kernels execute the same operations in the same order and get the same
// bits. The operators are in the namespace of their types, so argument-dependent lookup finds them in every module.

namespace ringfence {

inline constexpr double infinity = std::numeric_limits<double>::infinity();

constexpr Vec3f operator+(Vec3f p, Vec3f q) noexcept { return {p.x + q.x, p.y + q.y, p.z + q.z}; }
constexpr Vec3f operator-(Vec3f p, Vec3f q) noexcept { return {p.x - q.x, p.y - q.y, p.z - q.z}; }
constexpr Vec3f operator-(Vec3f p) noexcept { return {-p.x, -p.y, -p.z}; }
constexpr Vec3f operator*(Vec3f p, float s) noexcept { return {p.x * s, p.y * s, p.z * s}; }
constexpr float dot(Vec3f p, Vec3f q) noexcept { return (p.x * q.x + p.y * q.y) + p.z * q.z; }
constexpr Vec3f cross(Vec3f p, Vec3f q) noexcept {
  return {p.y * q.z - p.z * q.y, p.z * q.x - p.x * q.z, p.x * q.y - p.y * q.x};
}
inline float length(Vec3f p) noexcept { return std::sqrt(dot(p, p)); }

constexpr Vec3d operator+(Vec3d p, Vec3d q) noexcept { return {p.x + q.x, p.y + q.y, p.z + q.z}; }
constexpr Vec3d operator-(Vec3d p, Vec3d q) noexcept { return {p.x - q.x, p.y - q.y, p.z - q.z}; }
constexpr Vec3d operator-(Vec3d p) noexcept { return {-p.x, -p.y, -p.z}; }
constexpr Vec3d operator*(Vec3d p, double s) noexcept { return {p.x * s, p.y * s, p.z * s}; }
constexpr double dot(Vec3d p, Vec3d q) noexcept { return (p.x * q.x + p.y * q.y) + p.z * q.z; }
constexpr Vec3d cross(Vec3d p, Vec3d q) noexcept {
  return {p.y * q.z - p.z * q.y, p.z * q.x - p.x * q.z, p.x * q.y - p.y * q.x};
}
inline double length(Vec3d p) noexcept { return std::sqrt(dot(p, p)); }

constexpr Vec3d to_double(Vec3f p) noexcept { return {double{p.x}, double{p.y}, double{p.z}}; }
constexpr Vec3f to_float(Vec3d p) noexcept {
  return {static_cast<float>(p.x), static_cast<float>(p.y), static_cast<float>(p.z)};
}
/// `p`, shortened to `length` if it is longer.
inline Vec3f with_max_length(Vec3f p, float length) noexcept {
  const float squared = dot(p, p);
  return squared > length * length ? p * (length / std::sqrt(squared)) : p;
}
inline bool is_finite(Vec3f p) noexcept { return std::isfinite(p.x) && std::isfinite(p.y) && std::isfinite(p.z); }
inline bool is_finite(Vec3d p) noexcept { return std::isfinite(p.x) && std::isfinite(p.y) && std::isfinite(p.z); }

namespace geometry {

/// The least float that is not below `value`.
inline float rounded_up(double value) noexcept {
  const auto nearest = static_cast<float>(value);
  return double{nearest} < value ? std::nextafter(nearest, std::numeric_limits<float>::infinity()) : nearest;
}

/// A rotation matrix from the shape's axes to the world's: row i is world axis i, in the shape's axes.
template <class T>
struct RotationOf {
  T m[3][3];  ///< [row][column]
};
using Rotation = RotationOf<float>;
using RotationD = RotationOf<double>;

/// The matrix of a unit quaternion. Every kernel uses this formula.
template <class T>
constexpr RotationOf<T> rotation(T x, T y, T z, T w) noexcept {
  const T x2 = x + x, y2 = y + y, z2 = z + z;
  const T xx = x * x2, yy = y * y2, zz = z * z2;
  const T xy = x * y2, xz = x * z2, yz = y * z2;
  const T wx = w * x2, wy = w * y2, wz = w * z2;
  const T one = 1;
  return {
      {{one - (yy + zz), xy - wz, xz + wy}, {xy + wz, one - (xx + zz), yz - wx}, {xz - wy, yz + wx, one - (xx + yy)}}};
}
constexpr Rotation rotation(Quat q) noexcept { return rotation<float>(q.x, q.y, q.z, q.w); }
constexpr RotationD rotation_double(Quat q) noexcept { return rotation<double>(q.x, q.y, q.z, q.w); }

/// The matrix of a quaternion of any length but zero, in double. Divides by the length, because that of a unit
/// quaternion in float differs from 1 by rounding.
inline RotationD rotation_exact(Quat q) noexcept {
  const double x = q.x, y = q.y, z = q.z, w = q.w;
  const double norm = std::sqrt((x * x + y * y) + (z * z + w * w));
  return rotation<double>(x / norm, y / norm, z / norm, w / norm);
}

/// Rotates from the shape's axes to the world's.
constexpr Vec3f rotate(const Rotation& r, Vec3f p) noexcept {
  return {dot(Vec3f{r.m[0][0], r.m[0][1], r.m[0][2]}, p), dot(Vec3f{r.m[1][0], r.m[1][1], r.m[1][2]}, p),
          dot(Vec3f{r.m[2][0], r.m[2][1], r.m[2][2]}, p)};
}
constexpr Vec3d rotate(const RotationD& r, Vec3d p) noexcept {
  return {dot(Vec3d{r.m[0][0], r.m[0][1], r.m[0][2]}, p), dot(Vec3d{r.m[1][0], r.m[1][1], r.m[1][2]}, p),
          dot(Vec3d{r.m[2][0], r.m[2][1], r.m[2][2]}, p)};
}

/// Rotates from the world's axes to the shape's.
constexpr Vec3f rotate_inverse(const Rotation& r, Vec3f p) noexcept {
  return {dot(Vec3f{r.m[0][0], r.m[1][0], r.m[2][0]}, p), dot(Vec3f{r.m[0][1], r.m[1][1], r.m[2][1]}, p),
          dot(Vec3f{r.m[0][2], r.m[1][2], r.m[2][2]}, p)};
}
constexpr Vec3d rotate_inverse(const RotationD& r, Vec3d p) noexcept {
  return {dot(Vec3d{r.m[0][0], r.m[1][0], r.m[2][0]}, p), dot(Vec3d{r.m[0][1], r.m[1][1], r.m[2][1]}, p),
          dot(Vec3d{r.m[0][2], r.m[1][2], r.m[2][2]}, p)};
}

/// The quaternion scaled to unit length, computed in double and rounded once. Precondition: finite and not zero.
inline Quat normalise(Quat q) noexcept {
  const double x = q.x, y = q.y, z = q.z, w = q.w;
  const double norm = std::sqrt((x * x + y * y) + (z * z + w * w));
  return {static_cast<float>(x / norm), static_cast<float>(y / norm), static_cast<float>(z / norm),
          static_cast<float>(w / norm)};
}

/// Whether `q` is finite and its length is within 10^-3 of 1. The API refuses other orientations.
inline bool is_near_unit(Quat q) noexcept {
  const double x = q.x, y = q.y, z = q.z, w = q.w;
  const double norm = std::sqrt((x * x + y * y) + (z * z + w * w));
  return std::abs(norm - 1.0) <= 1e-3;  // false for NaN and infinity
}

}  // namespace geometry
}  // namespace ringfence
