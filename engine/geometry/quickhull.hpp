#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "ringfence/pose.hpp"

namespace ringfence::geometry {

/// A triangle of a closed convex surface: indices of input points, anticlockwise seen from outside, and the triangle
/// across the edge from corner i to corner i + 1.
struct HullTriangle {
  std::uint32_t corner[3];
  std::uint32_t across[3];
};

/// The hull of `points` as a closed surface of triangles, every input point within 4 * 10^-7 of the extent of it.
///
/// Points nearer than 2^-30 of the extent count as one. Throws ringfence::Error when fewer than 4 are distinct or all
/// lie in a plane. Precondition: the points are finite. Method: see build_hull.
std::vector<HullTriangle> quickhull(std::span<const Vec3f> points);

}  // namespace ringfence::geometry
