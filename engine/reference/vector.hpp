#pragma once

#include <cmath>
#include <limits>

#include "ringfence/pose.hpp"

namespace ringfence::reference {

inline constexpr double infinity = std::numeric_limits<double>::infinity();

/// Three doubles with the arithmetic that the reference needs. A separate type, because the reference shares no code
/// with what it checks.
struct Vector {
  double x = 0, y = 0, z = 0;

  constexpr Vector() = default;
  constexpr Vector(double x_, double y_, double z_) : x(x_), y(y_), z(z_) {}
  constexpr explicit Vector(const Vec3d& v) : x(v.x), y(v.y), z(v.z) {}
  constexpr explicit Vector(const Vec3f& v) : x(v.x), y(v.y), z(v.z) {}
  constexpr operator Vec3d() const { return {x, y, z}; }

  constexpr Vector operator-() const { return {-x, -y, -z}; }
  constexpr Vector& operator+=(const Vector& v) { return *this = {x + v.x, y + v.y, z + v.z}; }
  constexpr Vector& operator-=(const Vector& v) { return *this = {x - v.x, y - v.y, z - v.z}; }
};

constexpr Vector operator+(const Vector& p, const Vector& q) { return {p.x + q.x, p.y + q.y, p.z + q.z}; }
constexpr Vector operator-(const Vector& p, const Vector& q) { return {p.x - q.x, p.y - q.y, p.z - q.z}; }
constexpr Vector operator*(const Vector& p, double s) { return {p.x * s, p.y * s, p.z * s}; }
constexpr Vector operator*(double s, const Vector& p) { return p * s; }
constexpr double dot(const Vector& p, const Vector& q) { return p.x * q.x + p.y * q.y + p.z * q.z; }
constexpr Vector cross(const Vector& p, const Vector& q) {
  return {p.y * q.z - p.z * q.y, p.z * q.x - p.x * q.z, p.x * q.y - p.y * q.x};
}
inline double length(const Vector& p) { return std::sqrt(dot(p, p)); }
/// Precondition: `p` is not zero.
inline Vector normalised(const Vector& p) { return p * (1 / length(p)); }
/// A unit vector perpendicular to the unit vector `p`.
inline Vector perpendicular(const Vector& p) {
  const Vector axis = std::abs(p.x) < 0.6 ? Vector{1, 0, 0} : Vector{0, 1, 0};
  return normalised(cross(p, axis));
}

/// A rotation as its three columns.
struct Rotation {
  Vector columns[3] = {{1, 0, 0}, {0, 1, 0}, {0, 0, 1}};

  constexpr Vector operator*(const Vector& p) const { return columns[0] * p.x + columns[1] * p.y + columns[2] * p.z; }
  /// The inverse rotation of `p`.
  constexpr Vector inverse(const Vector& p) const {
    return {dot(columns[0], p), dot(columns[1], p), dot(columns[2], p)};
  }
};

/// The rotation of a quaternion, which is normalised in double first.
inline Rotation rotation_of(const Quat& q) {
  double x = q.x, y = q.y, z = q.z, w = q.w;
  const double s = 1 / std::sqrt(x * x + y * y + z * z + w * w);
  x *= s, y *= s, z *= s, w *= s;
  return {{{1 - 2 * (y * y + z * z), 2 * (x * y + z * w), 2 * (x * z - y * w)},
           {2 * (x * y - z * w), 1 - 2 * (x * x + z * z), 2 * (y * z + x * w)},
           {2 * (x * z + y * w), 2 * (y * z - x * w), 1 - 2 * (x * x + y * y)}}};
}

/// Position and orientation of one frame in another: x ↦ rotation · x + offset.
struct Placement {
  Rotation rotation;
  Vector offset;

  constexpr Vector operator*(const Vector& p) const { return rotation * p + offset; }
};

/// The frame of `b` in that of `a`. The difference of the positions is computed first, so it is precise far from the
/// origin.
inline Placement relative(const Pose& a, const Pose& b) {
  const Rotation ra = rotation_of(a.orientation), rb = rotation_of(b.orientation);
  Placement out;
  for (int i = 0; i < 3; ++i) out.rotation.columns[i] = ra.inverse(rb.columns[i]);
  out.offset = ra.inverse(Vector(b.position) - Vector(a.position));
  return out;
}

/// The inverse of a placement.
constexpr Placement inverse(const Placement& p) {
  const auto& c = p.rotation.columns;
  Placement out;
  out.rotation = {{{c[0].x, c[1].x, c[2].x}, {c[0].y, c[1].y, c[2].y}, {c[0].z, c[1].z, c[2].z}}};
  out.offset = -(out.rotation * p.offset);
  return out;
}

}  // namespace ringfence::reference
