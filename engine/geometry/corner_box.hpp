#pragma once

#include "ringfence/pose.hpp"

namespace ringfence::geometry {

/// A box with sides along the axes, in metres, both corners included; empty if a lower side is above the upper one.
struct CornerBox {
  Vec3d lower, upper;

  /// Whether the two overlap or touch.
  bool touches(const CornerBox& other) const noexcept {
    return lower.x <= other.upper.x && other.lower.x <= upper.x && lower.y <= other.upper.y &&
           other.lower.y <= upper.y && lower.z <= other.upper.z && other.lower.z <= upper.z;
  }
};

}  // namespace ringfence::geometry
