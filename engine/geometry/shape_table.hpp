#pragma once

#include <cstddef>
#include <cstdint>
#include <deque>
#include <memory>
#include <span>
#include <vector>

#include "geometry/bounds.hpp"
#include "geometry/hull.hpp"
#include "geometry/mesh.hpp"
#include "ringfence/ids.hpp"
#include "ringfence/shape.hpp"

namespace ringfence::geometry {

/// What a kernel needs to know of a shape without following a pointer: 32 bytes, read by gather.
struct ShapeRow {
  /// sphere: radius, 0, 0; box: the three half extents; capsule: radius, half height, 0; hull: its centroid; others: 0.
  /// Metres.
  float size[3] = {};
  float bounding_radius = 0;  ///< of a ball about the shape's origin that holds the shape
  ShapeKind kind = ShapeKind::sphere;
  std::uint8_t reserved[3] = {};
  std::uint32_t index_in_kind = 0;  ///< index of the hull, mesh or support function among its kind
  std::uint32_t reserved2[2] = {};
};
static_assert(sizeof(ShapeRow) == 32);

/// A shape where it stands.
struct PlacedShape {
  const Pose* pose;  ///< its orientation is unit
  ShapeNumber shape;
};

/// Every shape of a world, prepared once, then immutable and shared read-only by all threads.
///
/// Threads: `add` before any other thread reads, or between frames. Memory: rows and prepared shapes live as long as
/// the table; references to hulls stay valid when shapes are added.
class ShapeTable {
 public:
  ShapeTable();
  ~ShapeTable();
  ShapeTable(const ShapeTable&) = delete;
  ShapeTable& operator=(const ShapeTable&) = delete;

  /// Checks, prepares and adds a shape. Throws ringfence::Error naming what is wrong: a size that is not finite or out
  /// of range (no thinner than 1 mm, no larger than 10^6 m from the origin), a hull of fewer than 4 distinct points, a
  /// flat hull, too many hull vertices, a mesh index out of range. The table is as before when it throws.
  ShapeNumber add(const ShapeDescription& description);

  std::size_t size() const noexcept { return rows_.size(); }
  std::span<const ShapeRow> rows() const noexcept { return rows_; }
  const ShapeRow& row(ShapeNumber shape) const noexcept { return rows_[shape]; }
  const Hull& hull(std::uint32_t index_in_kind) const noexcept { return hulls_[index_in_kind]; }
  const Mesh& mesh(std::uint32_t index_in_kind) const noexcept { return *meshes_[index_in_kind]; }
  const SupportFunction& support(std::uint32_t index_in_kind) const noexcept { return *supports_[index_in_kind]; }
  /// As it was registered; what scenes are written from and what the reference reads.
  const ShapeDescription& description(ShapeNumber shape) const noexcept { return descriptions_[shape]; }

  /// Volume of the shape in cubic metres; 0 for meshes and support shapes.
  double volume(ShapeNumber shape) const noexcept;

  /// Tight bounds of a shape at a pose (a hull's by its support in six directions). The pose's orientation is unit.
  /// Widened by 2^-20 of the bounding radius, more than float rounding can take from the extent, so that shapes in
  /// contact always have bounds that touch. The same bits at every vector width.
  Bounds bounds(ShapeNumber shape, const Pose& pose, const FixedSpace& space) const noexcept;
  /// The same of many at once, a quarter quicker: `out[i]` are those of `placed[i]`, and where `points` is not null,
  /// `points[i]` is FixedSpace::point of its position, which costs next to nothing here.
  void bounds(std::span<const PlacedShape> placed, const FixedSpace& space, Bounds* out,
              FixedPoint* points = nullptr) const noexcept;

 private:
  Bounds rare_bounds(const ShapeRow& row, const Pose& pose, const FixedSpace& space) const noexcept;

  std::vector<ShapeRow> rows_;
  std::deque<ShapeDescription> descriptions_;
  std::deque<Hull> hulls_;
  std::vector<const Hull*> hull_of_;  ///< by shape; null where it is none
  std::vector<std::unique_ptr<Mesh>> meshes_;
  std::vector<std::shared_ptr<const SupportFunction>> supports_;
};

}  // namespace ringfence::geometry
