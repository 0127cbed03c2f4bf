#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "ringfence/pose.hpp"

namespace ringfence::geometry {

/// A triangle of a closed convex surface. Edge i leads from corner i to corner (i + 1) % 3.
struct HullTriangle {
  std::uint32_t corner[3];  ///< indices of input points, anticlockwise seen from outside
  std::uint32_t across[3];  ///< for each edge, the index of the triangle on its other side in the list of triangles
};

/// The convex hull of `points` as a closed surface of triangles. Every input point lies inside the surface or at most
/// 4 * 10^-7 of the extent outside. The extent is the longest side of the box around the points.
///
/// Coordinates are rounded to 2^-31 of the extent; points that are then equal count as one. Throws ringfence::Error if
/// fewer than 4 points are distinct or if all points lie in a plane, within 2 * 10^-6 of the extent. Precondition: the
/// points are finite. Method: see build_hull.
std::vector<HullTriangle> quickhull(std::span<const Vec3f> points);

}  // namespace ringfence::geometry
