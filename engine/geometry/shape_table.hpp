#pragma once

#include <cstddef>
#include <cstdint>
#include <deque>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "base/numbers.hpp"
#include "geometry/bounds.hpp"
#include "geometry/checked_support.hpp"
#include "geometry/growing_array.hpp"
#include "geometry/hull.hpp"
#include "geometry/mesh.hpp"
#include "geometry/shape_view.hpp"
#include "ringfence/shape.hpp"

namespace ringfence::geometry {

/// A shape at a pose.
struct PlacedShape {
  const Pose* pose;  ///< the orientation has unit length
  ShapeNumber shape;
};

/// The shapes of a world: each is prepared once, then immutable and shared read-only by all threads.
///
/// Threads: one thread adds at a time. Others may meanwhile read the shapes that are there, as the thread of a lost CD
/// node does. Memory: everything that is returned by reference or pointer keeps its address and value until the shape
/// is freed, or as long as the table exists; `rows` contains the shapes that exist when it is called.
class ShapeTable {
 public:
  ShapeTable();
  ~ShapeTable();
  ShapeTable(const ShapeTable&) = delete;
  ShapeTable& operator=(const ShapeTable&) = delete;

  /// Checks, prepares and adds a shape. Throws ringfence::Error that names the fault: a size that is not finite or out
  /// of range (thinner than 1 mm, or more than 10^6 m from the origin), a hull of fewer than 4 distinct points, a flat
  /// hull, too many hull vertices, a mesh index out of range, a support function that throws. The table is unchanged if
  /// it throws.
  ShapeNumber add(const ShapeDescription& description);

  /// Removes a shape; its number is not used again. What kernels read of it stays until free_removed(); then a ball of
  /// 0.5 mm is in its place, so a message that still names the shape does no harm. Precondition: has(shape).
  /// `time` is any number that does not decrease from call to call, such as that of a frame.
  void remove(ShapeNumber shape, std::uint64_t time = 0);
  /// Frees the shapes that were removed at `latest` or before. Precondition: no other thread reads these shapes
  /// meanwhile, and no object has them.
  void free_removed(std::uint64_t latest = ~std::uint64_t{0});
  /// Whether the shape was added and not removed. Only for the thread that adds.
  bool has(ShapeNumber shape) const noexcept { return shape < removed_.size() && !removed_[shape]; }
  /// One more than the number of the last shape, removed or not.
  std::size_t size() const noexcept { return rows_.size(); }
  std::span<const ShapeRow> rows() const noexcept { return rows_.span(); }
  const ShapeRow& row(ShapeNumber shape) const noexcept { return rows_[shape]; }
  const Hull& hull(std::uint32_t index_in_kind) const noexcept { return *hulls_[index_in_kind]; }
  const Mesh& mesh(std::uint32_t index_in_kind) const noexcept { return *meshes_[index_in_kind]; }
  const CheckedSupport& support(std::uint32_t index_in_kind) const noexcept { return *supports_[index_in_kind]; }
  /// The shapes that exist now, as kernels read them. Valid as long as the table.
  ShapeView view() const noexcept { return {rows_.data(), hulls_.data(), meshes_.data(), supports_.data()}; }
  /// The shape as it was registered, for writing scenes and for the reference implementation; a ball once it is
  /// removed. Only for the thread that adds.
  const ShapeDescription& description(ShapeNumber shape) const noexcept { return descriptions_[shape]; }

  /// Which support functions failed since the last call, and why: of each shape the first time only. For the log. From
  /// one thread at a time.
  std::vector<std::string> take_support_failures() const;

  /// Volume of the shape in cubic metres; 0 for meshes and support shapes.
  double volume(ShapeNumber shape) const noexcept;

  /// Tight bounds of a shape at a pose; those of a hull come from its support in six directions. Precondition: the
  /// orientation has unit length. Widened by 2^-20 of the bounding radius, which exceeds the float rounding error of
  /// the extent; so shapes in contact always have bounds that touch. The same bits at every vector width. If the
  /// function of a support shape fails, the result is the bounds of the shape's bounding ball.
  Bounds bounds(ShapeNumber shape, const Pose& pose, const FixedSpace& space) const noexcept;
  /// The bounds of many placed shapes: takes a quarter less time for each. `out[i]` are the bounds of `placed[i]`. If
  /// `points` is not null, `points[i]` is FixedSpace::point of its position, at almost no extra cost.
  void bounds(std::span<const PlacedShape> placed, const FixedSpace& space, Bounds* out,
              FixedPoint* points = nullptr) const noexcept;

 private:
  Bounds slow_bounds(const ShapeRow& row, const Pose& pose, const FixedSpace& space) const noexcept;

  GrowingArray<ShapeRow> rows_;
  GrowingArray<const Hull*> hull_of_;  ///< by shape number; null if the shape is not a hull
  GrowingArray<const Hull*> hulls_;
  GrowingArray<const Mesh*> meshes_;
  GrowingArray<const CheckedSupport*> supports_;
  // Accessed only by the thread that adds.
  std::deque<ShapeDescription> descriptions_;
  std::vector<bool> removed_;  ///< by shape number
  struct Removed {
    ShapeNumber shape;
    std::uint64_t time;
  };
  std::vector<Removed> to_be_freed_;  ///< in order of time
  std::vector<std::unique_ptr<const Hull>> owned_hulls_;
  std::vector<std::unique_ptr<const Mesh>> owned_meshes_;
  std::vector<std::unique_ptr<const CheckedSupport>> owned_supports_;
};

}  // namespace ringfence::geometry
