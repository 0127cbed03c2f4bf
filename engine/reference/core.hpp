#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "reference/vector.hpp"
#include "ringfence/shape.hpp"

namespace ringfence::reference {

/// A convex shape in the reference: all points within `radius` of a convex polytope, or of the shape that a support
/// function describes. A sphere is a rounded point, a capsule a rounded segment.
///
/// A polytope carries its Gauss map: the unit normals of its faces and, for every edge, the arc of directions between
/// the normals of its two faces. Flat shapes (point, segment, triangle) are described as the limit of a solid whose
/// thickness goes to zero, a box or a prism, with directions for edges of zero length. So one exhaustive test covers
/// all of them, degenerate or not.
struct Core {
  /// An edge of the solid; its length may be zero.
  struct Arc {
    Vector direction;        ///< unit, along the edge; either direction
    Vector point;            ///< a point on the edge
    std::uint32_t faces[2];  ///< the two adjacent faces; the angle between their normals is less than 180 degrees
    bool has_length = true;
  };

  std::vector<Vector> vertices;  ///< distinct
  std::vector<Vector> normals;   ///< unit, outwards
  std::vector<double> offsets;   ///< the largest normals[i] · x on the polytope
  std::vector<Arc> arcs;
  std::vector<std::array<std::uint32_t, 2>> segments;   ///< the edges of the point set, without those of zero length
  std::vector<std::array<std::uint32_t, 3>> triangles;  ///< the surface as triangles, without those of zero area
  bool flat = false;                                    ///< a point, a segment, a triangle or a rectangle
  double radius = 0;                                    ///< added on all sides, metres
  double reach = 0;  ///< radius of a ball about the origin that holds the polytope, metres
  std::shared_ptr<const SupportFunction> function;  ///< if set, the core is not a polytope; all lists are empty

  /// The largest value of direction · x on the core, without the radius. `direction` need not be a unit vector.
  double extent(const Vector& direction) const;
  /// A point of the core that has this value.
  Vector support(const Vector& direction) const;
};

/// A box about the origin; half extents may be zero. The corners are distinct.
Core box_core(const Vector& half_extents);

/// The hull of points. Throws std::invalid_argument if they all lie in one plane.
Core hull_core(std::span<const Vec3f> points);

/// A core that is described by a support function only.
Core function_core(std::shared_ptr<const SupportFunction> function);

/// Makes `core` the triangle, whose area must not be zero. Reuses its memory.
void set_triangle(Core& core, const Vector& a, const Vector& b, const Vector& c);

/// The core of a convex shape. Throws std::invalid_argument for a triangle mesh.
Core core_of(const ShapeDescription& shape);

}  // namespace ringfence::reference
