#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "ringfence/pose.hpp"

namespace ringfence::geometry {

/// A triangle of a closed convex surface: indices of input points, anticlockwise seen from outside, and for each edge i
/// (from corner i to corner i + 1) the triangle on its other side.
struct HullTriangle {
  std::uint32_t corner[3];
  std::uint32_t across[3];
};

/// The convex hull of `points` as a closed surface of triangles. Every input point lies inside it or at most 4 * 10^-7
/// of the extent outside.
///
/// Points closer than 2^-30 of the extent count as one. Throws ringfence::Error if fewer than 4 points are distinct or
/// all lie in a plane. Precondition: the points are finite. Method: see build_hull.
std::vector<HullTriangle> quickhull(std::span<const Vec3f> points);

}  // namespace ringfence::geometry
