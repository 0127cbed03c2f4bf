#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "base/aligned.hpp"
#include "geometry/vector.hpp"
#include "ringfence/pose.hpp"

namespace ringfence::geometry {

/// Every column of a prepared hull is padded to a multiple of this number of floats: the width of the widest vector.
inline constexpr std::size_t hull_lanes = 16;
/// Numbers of 16 bits are padded to a multiple of this.
inline constexpr std::size_t fixed_point_lanes = 2 * hull_lanes;
/// Maximum number of vertices of a prepared hull.
inline constexpr std::size_t max_hull_vertices = 256;

/// `count` rounded up to whole vectors.
constexpr std::size_t padded(std::size_t count) noexcept { return (count + hull_lanes - 1) / hull_lanes * hull_lanes; }

/// `count` rounded up to a multiple of fixed_point_lanes.
constexpr std::size_t padded_fixed_point(std::size_t count) noexcept {
  return (count + fixed_point_lanes - 1) / fixed_point_lanes * fixed_point_lanes;
}

/// An edge and its two faces in one cache line. Seen from outside, the left face is to the left of the direction `from`
/// to `to`. The first 48 bytes are three rows of four floats, so kernels that test single edges load one with three
/// vector loads.
struct alignas(64) HullEdge {
  Vec3f left_normal;  ///< outward unit normal of the left face, as in the faces' columns
  float from_x;       ///< coordinates of vertex `from`
  Vec3f right_normal;
  float from_y;
  Vec3f along;  ///< unit direction from `from` to `to`
  float from_z;
  float length;
  std::uint16_t from, to;
  std::uint16_t left, right;
};
static_assert(sizeof(HullEdge) == 64);

/// The vertices of an edge: for what reads only these, one cache line instead of one for each edge.
struct EdgeEnds {
  std::uint8_t from, to;
};
static_assert(max_hull_vertices <= 256);

/// Alignment in bytes of the columns of faces_of_edges(): the width of the widest vector.
inline constexpr std::size_t face_column_bytes = 64;

/// The columns of edge_column(): the unit normals of the edge's two faces, its first vertex, its unit direction and its
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
/// Vertices are input points, unchanged to the bit. No input point lies more than 10^-6 of the hull's size outside.
/// Faces are polygons: neighbouring triangles that are coplanar within 5 * 10^-7 of the size form one face. Columns are
/// a structure of arrays: each starts on a cache line and is padded to a multiple of 16 entries by copies of the first.
/// Coordinates are relative to the shape, in metres.
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

  /// Outward unit normals of the faces and their offsets: padded(face_count()) floats each. The offset is the hull's
  /// support in the direction of the normal: the maximum of normal · vertex over all vertices, rounded up.
  const float* normal_x() const noexcept { return faces_.data(); }
  const float* normal_y() const noexcept { return normal_x() + padded(face_count_); }
  const float* normal_z() const noexcept { return normal_y() + padded(face_count_); }
  const float* offset() const noexcept { return normal_z() + padded(face_count_); }
  Vec3f normal(std::size_t i) const noexcept { return {normal_x()[i], normal_y()[i], normal_z()[i]}; }

  /// The planes of the faces in fixed point, rounded to the nearest, for bounds: for each group of fixed_point_lanes
  /// faces as many x components of their normals, then y and z, in units of 2^-15, then the distances of the planes
  /// from the centroid in units of extent() * 2^-15. 32767 where 32768 would be needed.
  const std::int16_t* fixed_point_planes() const noexcept { return fixed_point_planes_.data(); }

  std::span<const HullEdge> edges() const noexcept { return edges_; }
  EdgeEnds edge_ends(std::size_t edge) const noexcept { return edge_ends_[edge]; }
  /// One value of every edge, as kernels read it: padded(edge_count()) floats.
  const float* edge_column(EdgeColumn column) const noexcept {
    return edge_columns_.data() + static_cast<std::size_t>(column) * padded(edges_.size());
  }
  /// For hulls of at most 256 faces: one byte for each edge with the number of its left face, zero-padded to a multiple
  /// of face_column_bytes; then the same for the right faces. Null for larger hulls.
  const std::uint8_t* faces_of_edges() const noexcept {
    return faces_of_edges_.empty() ? nullptr : faces_of_edges_.data();
  }
  /// The vertices of face `i`, anticlockwise seen from outside.
  std::span<const std::uint16_t> face(std::size_t i) const noexcept {
    return {face_vertices_.data() + face_starts_[i], face_starts_[i + 1] - face_starts_[i]};
  }

  /// Centre of mass of the solid; lies inside it.
  Vec3f centroid() const noexcept { return centroid_; }
  double volume() const noexcept { return volume_; }
  /// Radius of a ball around the coordinate origin that contains the hull; rounded up.
  float bounding_radius() const noexcept { return bounding_radius_; }
  /// Radius of a ball around the centroid that the hull contains; rounded down.
  float inner_radius() const noexcept { return inner_radius_; }
  /// Radius of a ball around the centroid that contains the hull; rounded up.
  float extent() const noexcept { return extent_; }

 private:
  friend class HullAssembly;
  std::size_t vertex_count_ = 0;
  std::size_t face_count_ = 0;
  base::AlignedVector<float> vertices_;
  base::AlignedVector<float> faces_;
  base::AlignedVector<std::int16_t> fixed_point_planes_;
  base::AlignedVector<float> edge_columns_;
  base::AlignedVector<std::uint8_t> faces_of_edges_;
  base::AlignedVector<HullEdge> edges_;
  std::vector<EdgeEnds> edge_ends_;
  std::vector<std::uint32_t> face_starts_;
  std::vector<std::uint16_t> face_vertices_;
  Vec3f centroid_;
  double volume_ = 0;
  float bounding_radius_ = 0;
  float inner_radius_ = 0;
  float extent_ = 0;
};

/// Builds the convex hull of `points`.
///
/// Throws ringfence::Error if a coordinate is not finite, fewer than 4 points are distinct, all points lie in a plane
/// (within 2 * 10^-6 of their extent), or the hull has more than 256 vertices. Method: Quickhull (Barber, Dobkin and
/// Huhdanpaa 1996), which adds only points that lie outside by more than rounding. Each point is added by an
/// incremental step with exact integer predicates on coordinates rounded to 2^-30 of the extent, so the surface is
/// closed and convex after every step for any input. Cost: about 2 µs for each input point.
Hull build_hull(std::span<const Vec3f> points);

}  // namespace ringfence::geometry
