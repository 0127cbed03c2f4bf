#pragma once

#include <cstddef>

#include "geometry/hull.hpp"
#include "geometry/shape_table.hpp"
#include "ringfence/pose.hpp"

namespace ringfence::narrow_phase {

inline constexpr std::size_t max_faces = 2 * geometry::max_hull_vertices;
inline constexpr std::size_t max_edges = 3 * geometry::max_hull_vertices;

/// A hull or a box as the convex kernels read it: columns of float, aligned and padded as in geometry::Hull, which
/// also says what they hold. Points into what it was made from.
struct Polytope {
  const float* vertex[3];  ///< x, y, z
  const float* normal[3];
  const float* offset;
  const float* edge[geometry::edge_columns];
  const geometry::HullEdge* ends;      ///< the two vertices of each edge
  std::size_t vertices, faces, edges;  ///< counts without the padding
  Vec3f centre;                        ///< of a ball inside
  float inner_radius;                  ///< of that ball
  float outer_radius;                  ///< of a ball about the origin that holds it

  const float* of(geometry::EdgeColumn column) const noexcept { return edge[static_cast<std::size_t>(column)]; }
};

/// A prepared hull.
Polytope polytope_of(const geometry::Hull& hull) noexcept;

/// A box of any size: the columns that depend on it, the rest is the unit box's. Must not move once made.
class BoxPolytope {
 public:
  /// `size` are the half extents, as in ShapeRow.
  explicit BoxPolytope(const float size[3]) noexcept;
  BoxPolytope(const BoxPolytope&) = delete;
  BoxPolytope& operator=(const BoxPolytope&) = delete;

  const Polytope& polytope() const noexcept { return polytope_; }

 private:
  alignas(64) float vertex_[3][geometry::hull_lanes];
  alignas(64) float offset_[geometry::hull_lanes];
  alignas(64) float from_[3][geometry::hull_lanes];
  alignas(64) float length_[geometry::hull_lanes];
  Polytope polytope_;
};

}  // namespace ringfence::narrow_phase
