#pragma once

#include <cstddef>
#include <cstdint>

#include "geometry/hull.hpp"
#include "geometry/shape_table.hpp"
#include "ringfence/pose.hpp"

namespace ringfence::narrow_phase {

// Upper limits for a hull of max_hull_vertices vertices (Euler's formula).
inline constexpr std::size_t max_faces = 2 * geometry::max_hull_vertices;
inline constexpr std::size_t max_edges = 3 * geometry::max_hull_vertices;

/// A hull or a box in the layout that the convex kernels read: columns of float, aligned and padded as in
/// geometry::Hull, which documents them. Lengths in metres, in the axes of the shape. Points into the Hull or
/// BoxPolytope from which it is made, and is valid as long as that object exists.
struct Polytope {
  const float* vertex[3];              ///< x, y and z of the vertices
  const float* normal[3];              ///< x, y and z of the outward unit normals of the faces
  const float* offset;                 ///< the offsets of the faces
  const float* edge_columns;           ///< as in geometry::Hull; null for a box
  const geometry::HullEdge* edge;      ///< for a box, `from_x` to `from_z` and `length` are those of the unit box
  const std::uint8_t* faces_of_edges;  ///< as in geometry::Hull
  std::size_t vertices, faces, edges;  ///< counts without the padding
  Vec3f centre;                        ///< of a ball inside the polytope
  float inner_radius;                  ///< of that ball
  float outer_radius;                  ///< of a ball about the origin that holds the polytope

  /// One column of edge_columns. Precondition: not a box.
  const float* of(geometry::EdgeColumn column) const noexcept {
    return edge_columns + static_cast<std::size_t>(column) * geometry::padded(edges);
  }
};

/// The polytope of a prepared hull.
inline Polytope polytope_of(const geometry::Hull& hull) noexcept {
  return {{hull.x(), hull.y(), hull.z()},
          {hull.normal_x(), hull.normal_y(), hull.normal_z()},
          hull.offset(),
          hull.edge_column(geometry::EdgeColumn::left_x),
          hull.edges().data(),
          hull.faces_of_edges(),
          hull.vertex_count(),
          hull.face_count(),
          hull.edge_count(),
          hull.centroid(),
          hull.inner_radius(),
          hull.bounding_radius()};
}

/// A box of any size: owns the columns that depend on the size and shares the others with the unit box. Cannot be
/// moved. Threads: any; the first construction in a process also allocates and prepares the unit box.
class BoxPolytope {
 public:
  /// `size` holds the half extents in metres, as in ShapeRow.
  explicit BoxPolytope(const float size[3]) noexcept;
  BoxPolytope(const BoxPolytope&) = delete;
  BoxPolytope& operator=(const BoxPolytope&) = delete;

  /// Valid as long as this object exists.
  const Polytope& polytope() const noexcept { return polytope_; }

 private:
  alignas(64) float vertex_[3][geometry::hull_lanes];
  alignas(64) float offset_[geometry::hull_lanes];
  Polytope polytope_;
};

}  // namespace ringfence::narrow_phase
