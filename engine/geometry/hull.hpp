#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "base/aligned.hpp"
#include "geometry/vector.hpp"
#include "ringfence/pose.hpp"

namespace ringfence::geometry {

/// Lanes that every column of a prepared hull is padded to, the widest vector of float there is.
inline constexpr std::size_t hull_lanes = 16;
/// Vertices that a prepared hull may have.
inline constexpr std::size_t max_hull_vertices = 256;

/// `count` padded to whole vectors.
constexpr std::size_t padded(std::size_t count) noexcept { return (count + hull_lanes - 1) / hull_lanes * hull_lanes; }

/// An edge and the two faces that meet in it: one cache line. Seen from outside, the left face lies to the left of
/// `from` -> `to`. Where edges are looked at one by one, three rows of four floats hold all that is to be known of one.
struct alignas(64) HullEdge {
  Vec3f left_normal;  ///< outward, unit, as in the faces' columns
  float from_x;       ///< the coordinates of vertex `from`
  Vec3f right_normal;
  float from_y;
  Vec3f along;  ///< unit, from `from` to `to`
  float from_z;
  float length;
  std::uint16_t from, to;
  std::uint16_t left, right;
};
static_assert(sizeof(HullEdge) == 64);

/// Bytes that the columns of an edge's faces are padded to, the widest vector there is.
inline constexpr std::size_t face_column_bytes = 64;

/// The columns of an edge: the unit normals of its two faces, the vertex it starts from, its unit direction and its
/// length.
enum class EdgeColumn : std::size_t {
  left_x,
  left_y,
  left_z,
  right_x,
  right_y,
  right_z,
  from_x,
  from_y,
  from_z,
  along_x,
  along_y,
  along_z,
  length
};
inline constexpr std::size_t edge_columns = 13;

/// A convex polytope, prepared once for the kernels, then immutable.
///
/// Vertices are points of the input, bit for bit; none is left out that lies more than 10^-6 of the hull's size
/// outside. Faces are polygons: neighbouring triangles that are flat within 5 * 10^-7 of the size are one face. Columns
/// are structure of arrays, start on a cache line and are padded to a multiple of 16 by repeating the first entry.
/// Coordinates are the shape's, in metres.
class Hull {
 public:
  std::size_t vertex_count() const noexcept { return vertex_count_; }
  std::size_t face_count() const noexcept { return face_count_; }
  std::size_t edge_count() const noexcept { return edges_.size(); }

  /// Vertex coordinates: padded(vertex_count()) floats each.
  const float* x() const noexcept { return vertices_.data(); }
  const float* y() const noexcept { return x() + padded(vertex_count_); }
  const float* z() const noexcept { return y() + padded(vertex_count_); }
  Vec3f vertex(std::size_t i) const noexcept { return {x()[i], y()[i], z()[i]}; }

  /// Outward unit normals of the faces and their offsets: padded(face_count()) floats each. The offset is the
  /// greatest of normal · vertex over all vertices, rounded up: the hull's support in that direction.
  const float* normal_x() const noexcept { return faces_.data(); }
  const float* normal_y() const noexcept { return normal_x() + padded(face_count_); }
  const float* normal_z() const noexcept { return normal_y() + padded(face_count_); }
  const float* offset() const noexcept { return normal_z() + padded(face_count_); }
  Vec3f normal(std::size_t i) const noexcept { return {normal_x()[i], normal_y()[i], normal_z()[i]}; }

  std::span<const HullEdge> edges() const noexcept { return edges_; }
  /// What kernels read of an edge: padded(edge_count()) floats a column.
  const float* edge_column(EdgeColumn column) const noexcept {
    return edge_columns_.data() + static_cast<std::size_t>(column) * padded(edges_.size());
  }
  /// For hulls of at most 256 faces, the left faces of all edges in a byte each, padded with zeros to whole
  /// face_column_bytes, then the right faces likewise; null for larger ones.
  const std::uint8_t* faces_of_edges() const noexcept {
    return faces_of_edges_.empty() ? nullptr : faces_of_edges_.data();
  }
  /// The vertices around face `i`, anticlockwise seen from outside.
  std::span<const std::uint16_t> face(std::size_t i) const noexcept {
    return {face_vertices_.data() + face_starts_[i], face_starts_[i + 1] - face_starts_[i]};
  }

  /// Centre of the solid, a point inside.
  Vec3f centroid() const noexcept { return centroid_; }
  double volume() const noexcept { return volume_; }
  /// Of the ball about the coordinate origin that holds the hull, rounded up.
  float bounding_radius() const noexcept { return bounding_radius_; }
  /// Of a ball about the centroid that the hull holds, rounded down.
  float inner_radius() const noexcept { return inner_radius_; }

 private:
  friend class HullAssembly;
  std::size_t vertex_count_ = 0;
  std::size_t face_count_ = 0;
  base::AlignedVector<float> vertices_;
  base::AlignedVector<float> faces_;
  base::AlignedVector<float> edge_columns_;
  base::AlignedVector<std::uint8_t> faces_of_edges_;
  base::AlignedVector<HullEdge> edges_;
  std::vector<std::uint32_t> face_starts_;
  std::vector<std::uint16_t> face_vertices_;
  Vec3f centroid_;
  double volume_ = 0;
  float bounding_radius_ = 0;
  float inner_radius_ = 0;
};

/// The hull of `points`.
///
/// Throws ringfence::Error when a coordinate is not finite, fewer than 4 points are distinct, all lie in a plane
/// (within 2 * 10^-6 of their extent), or the hull has more than 256 vertices. Method: Quickhull (Barber, Dobkin and
/// Huhdanpaa 1996) that adds only points that lie outside by more than rounding; each is added by an incremental step
/// with exact integer predicates on coordinates rounded to 2^-30 of the extent, so that the surface is closed and
/// convex at every step whatever the input. Cost: about 2 µs an input point.
Hull build_hull(std::span<const Vec3f> points);

}  // namespace ringfence::geometry
