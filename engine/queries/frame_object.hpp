#pragma once

#include <cstdint>

#include "base/numbers.hpp"
#include "ringfence/ids.hpp"
#include "ringfence/pose.hpp"
#include "ringfence/query.hpp"

namespace ringfence::queries {

/// What queries read of an object of a frame: one cache line. Only present objects have one.
struct alignas(64) FrameObject {
  Pose pose;
  ShapeNumber shape = 0;
  ObjectNumber number = 0;
  std::uint32_t generation = 0;
  std::uint32_t group = 0;
  std::uint32_t slot = 0;  ///< where the frame keeps what only answers need, such as user data
  std::uint8_t layer = 0;
  std::uint8_t category = 0;  ///< a ringfence::Category
  std::uint8_t jumped = 0;    ///< 1: it was placed at the pose, and did not move there from the frame before
};
static_assert(sizeof(FrameObject) == 64);

/// The pose on the way from `from` to `to`, at `fraction` (0 to 1): the position linear, the orientation linear and
/// then normalised, the shorter way. The same bits on every machine.
Pose interpolate(const Pose& from, const Pose& to, double fraction) noexcept;

/// The cosine of half the angle by which a shape turns on the way between two orientations, 0 to 1.
double turn_cosine(const Quat& from, const Quat& to) noexcept;
/// An upper bound of how far a point of a shape is, anywhere on such a way, from the straight line between its places
/// at both ends, for each metre between the point and the shape's origin.
double most_bulge(double turn_cosine) noexcept;

/// Whether a query with that filter may find the object.
constexpr bool admits(const QueryFilter& filter, const FrameObject& object) noexcept {
  return (filter.layers >> object.layer & 1) != 0 && (filter.categories >> object.category & 1) != 0 &&
         (filter.except_group == 0 || object.group != filter.except_group) &&
         (object.number != filter.except.number() || object.generation != filter.except.generation());
}

}  // namespace ringfence::queries
