#pragma once

#include <vector>

#include "picture/drawing.hpp"
#include "ringfence/pose.hpp"
#include "ringfence/shape.hpp"

namespace ringfence::tools {

/// The outline of an object seen from above (against the z axis): the corners of a convex polygon in the x y plane of
/// the world, counter-clockwise, or a circle. Metres, relative to the position of the object.
struct Outline {
  std::vector<Point> corners;  ///< empty for a circle
  double radius = 0;           ///< largest distance of the outline from the position
};

/// Meshes have the outline of their convex hull. A support function that throws has no outline: radius 0.
Outline outline_of(const ShapeDescription& shape, Quat orientation);

/// The convex hull of the points, counter-clockwise, without points on its edges. Method: Andrew 1979.
std::vector<Point> convex_hull(std::vector<Point> points);

}  // namespace ringfence::tools
