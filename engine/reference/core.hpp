#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "reference/vector.hpp"
#include "ringfence/shape.hpp"

namespace ringfence::reference {

/// A convex shape as the reference sees it: all points within `radius` of a convex polytope, or of what a support
/// function describes. A sphere is a rounded point, a capsule a rounded segment.
///
/// A polytope carries its Gauss map: the unit normals of its faces and, for every edge, the arc of directions between
/// the normals of its two faces. What is flatter than a solid (point, segment, triangle) is described as the solid of
/// no thickness that it is the limit of, a box or a prism, with directions for edges of no length; so one exhaustive
/// test serves all, degenerate or not.
struct Core {
  /// An edge of the solid, possibly of no length.
  struct Arc {
    Vector direction;        ///< unit, along the edge; either sense
    Vector point;            ///< a point on the edge
    std::uint32_t faces[2];  ///< the two faces it borders; their normals are less than half a turn apart
    bool has_length = true;
  };

  std::vector<Vector> vertices;  ///< distinct
  std::vector<Vector> normals;   ///< unit, outwards
  std::vector<double> offsets;   ///< the largest normals[i] · x on the polytope
  std::vector<Arc> arcs;
  std::vector<std::array<std::uint32_t, 2>> segments;   ///< its edges as a set of points: none of no length
  std::vector<std::array<std::uint32_t, 3>> triangles;  ///< its surface in triangles: none of no area
  bool flat = false;                                    ///< a point, a segment, a triangle or a rectangle
  double radius = 0;                                    ///< added all around, metres
  double reach = 0;                                     ///< of a ball about the origin that holds the polytope
  std::shared_ptr<const SupportFunction> function;      ///< if set, the core is not a polytope; all lists are empty

  /// The largest direction · x on the core, without the radius. `direction` need not be unit.
  double extent(const Vector& direction) const;
  /// A point of the core where it is reached.
  Vector support(const Vector& direction) const;
};

/// A box about the origin; half extents may be zero. Distinct corners only.
Core box_core(const Vector& half_extents);

/// The hull of points. Throws std::invalid_argument if they are all in one plane.
Core hull_core(std::span<const Vec3f> points);

/// The core that only a support function describes.
Core function_core(std::shared_ptr<const SupportFunction> function);

/// Makes `core` the triangle, which must have an area, reusing its memory.
void set_triangle(Core& core, const Vector& a, const Vector& b, const Vector& c);

/// The core of a convex shape; throws std::invalid_argument for a triangle mesh.
Core core_of(const ShapeDescription& shape);

}  // namespace ringfence::reference
