#pragma once

#include <cstddef>
#include <cstdint>
#include <span>

#include "geometry/bounds.hpp"
#include "geometry/shape_view.hpp"
#include "geometry/vector.hpp"
#include "queries/frame_object.hpp"
#include "ringfence/pose.hpp"

namespace ringfence::queries {

/// A box of a BoxTree: metres from the tree's origin, rounded outwards. Sides may be infinite.
struct TreeBox {
  float lower[3];
  float upper[3];
};

/// The bounds of the object in a row, and the metres by which its box is wider on each side. Vectors of four numbers
/// are loaded from it.
struct alignas(32) RowBounds {
  geometry::Bounds bounds;
  float margin;
};
static_assert(sizeof(RowBounds) == 32);

/// Some rows in an order.
struct RowOrder {
  std::span<const RowBounds> rows;
  const std::uint32_t* numbers;  ///< of rows, `size` of them; null: all rows, in their order
  std::size_t size;

  const RowBounds& operator[](std::size_t i) const noexcept { return rows[numbers == nullptr ? i : numbers[i]]; }
};

/// The exact tests allow shapes to be this far apart, relative to their size. Boxes are widened by it, so that the
/// index cannot leave out what a test would find. Support functions return floats, for which the search ends early.
constexpr float tolerance_of(ShapeKind kind) noexcept { return kind == ShapeKind::support ? 0x1p-12f : 0x1p-16f; }
/// Metres by which a box is wider than the bounds of such a shape.
inline float margin_of(const geometry::ShapeRow& shape) noexcept {
  return shape.bounding_radius * tolerance_of(shape.kind);
}

/// Converts bounds in a FixedSpace to boxes that contain them. Bounds that saturate become infinite.
///
/// Threads: immutable.
class BoxConverter {
 public:
  BoxConverter(const geometry::FixedSpace& space, const Vec3d& origin) noexcept;

  TreeBox operator()(const RowBounds& row) const noexcept;

  const Vec3d& origin() const noexcept { return origin_; }
  // For kernels. A step from first() to last() is at offset + step * metres.
  double offset(std::size_t axis) const noexcept { return offset_[axis]; }
  double metres(std::size_t axis) const noexcept { return metres_[axis]; }
  float slack(std::size_t axis) const noexcept { return slack_[axis]; }
  std::uint32_t first() const noexcept { return first_; }
  std::uint32_t last() const noexcept { return last_; }
  /// A place is converted to a float with this relative error at most, with what is added to it.
  static constexpr float rounding = 0x1p-22f;

 private:
  double place(std::size_t axis, std::uint32_t step, bool up) const noexcept;

  Vec3d origin_;
  double offset_[3];            ///< place of step 0 if all steps had the same size, metres from the origin
  double metres_[3];            ///< of a step
  float slack_[3];              ///< metres: a step, and rounding
  std::uint32_t first_, last_;  ///< the steps of equal size, both included
};

/// Whether the boxes of objects at that place are precise: they are a quarter of a millimetre wider at most.
inline bool is_near_origin(const BoxConverter& box_of, const Vec3d& place) noexcept {
  return length(box_of.origin() - place) <= 1024;
}

/// An origin in the midst of most objects, where floats are precise: the medians of the positions of some of the
/// objects `rows[objects[i]]`; zero if there are none.
Vec3d choose_origin(std::span<const FrameObject> rows, std::span<const std::uint32_t> objects);

/// A space for the bounds of objects around that origin: its steps are small where most objects are.
geometry::FixedSpace space_around(const Vec3d& origin, std::span<const FrameObject> rows,
                                  std::span<const std::uint32_t> objects);

}  // namespace ringfence::queries
