#pragma once

#include <cstdint>
#include <type_traits>

namespace ringfence {

/// Three doubles: a position or displacement in metres.
struct Vec3d {
  double x = 0, y = 0, z = 0;
  constexpr bool operator==(const Vec3d&) const noexcept = default;
};

/// Three floats: a direction, a size or a displacement in metres.
struct Vec3f {
  float x = 0, y = 0, z = 0;
  constexpr bool operator==(const Vec3f&) const noexcept = default;
};

/// A rotation as a unit quaternion, order x y z w. Accepted within 10^-3 of unit length, then normalised.
struct Quat {
  float x = 0, y = 0, z = 0, w = 1;
  constexpr bool operator==(const Quat&) const noexcept = default;
};

/// Where an object is: the position of its shape's coordinate origin in metres, and the rotation of its shape's axes.
struct Pose {
  Vec3d position;
  Quat orientation;
  constexpr bool operator==(const Pose&) const noexcept = default;
};

/// Largest distance of an object from the origin on each axis, metres; larger coordinates are refused like infinity.
/// Beyond it the spacing of doubles exceeds 0.1 m, and squared distances do not fit the narrow phase's floats.
inline constexpr double farthest_coordinate = 1e15;

static_assert(sizeof(Vec3d) == 24 && sizeof(Vec3f) == 12 && sizeof(Quat) == 16 && sizeof(Pose) == 40);
static_assert(std::is_trivially_copyable_v<Pose> && std::is_standard_layout_v<Pose>);

}  // namespace ringfence
