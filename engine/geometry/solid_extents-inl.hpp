// Extents of spheres, boxes, capsules and hulls along the axes of the world, one object per lane. Included once for
// each Highway target.

#if defined(RINGFENCE_GEOMETRY_SOLID_EXTENTS_INL) == defined(HWY_TARGET_TOGGLE)
#ifdef RINGFENCE_GEOMETRY_SOLID_EXTENTS_INL
#undef RINGFENCE_GEOMETRY_SOLID_EXTENTS_INL
#else
#define RINGFENCE_GEOMETRY_SOLID_EXTENTS_INL
#endif

#include <cstddef>
#include <cstdint>

#include "geometry/hull.hpp"
#include "geometry/max_lanes-inl.hpp"
#include "geometry/rows-inl.hpp"
#include "geometry/shape_table.hpp"

HWY_BEFORE_NAMESPACE();
namespace ringfence::geometry::HWY_NAMESPACE {

/// Objects that go through each step together, so that no step waits for stores of the one before.
constexpr std::size_t batch = 64;

using Floats = hn::CappedTag<float, 8>;

/// One number for each object of a batch.
using FloatColumn = float[batch];

/// Rotation matrices: entry (i, j) of each.
struct Rotations {
  alignas(64) FloatColumn entry[3][3];
};

/// Extents along the world's axes relative to the origin of each shape, and what widens them on all sides.
struct Extents {
  alignas(64) FloatColumn lower[3], upper[3];
  alignas(64) FloatColumn radius;           ///< of spheres and capsules, else 0
  alignas(64) FloatColumn bounding_radius;  ///< the margin for rounding is a part of it
};

/// What is computed: up to `batch` shapes, at least one.
struct Batch {
  const PlacedShape* placed;
  std::size_t count;
  const ShapeRow* rows;
  const Hull* const* hulls;

  /// Past the end the last shape.
  HWY_INLINE const PlacedShape& at(std::size_t i) const { return placed[i < count ? i : count - 1]; }
};

/// Computes rotation matrices with the terms of rotation(): 1 - (p + q) on the diagonal, p + q or p - q elsewhere.
HWY_INLINE void compute_rotations(Floats d, const hn::Vec<Floats>* q, hn::Vec<Floats> (&m)[3][3]) {
  const auto x = q[0], y = q[1], z = q[2], w = q[3], one = hn::Set(d, 1.0f);
  const auto x2 = x + x, y2 = y + y, z2 = z + z;
  m[0][0] = one - (y * y2 + z * z2);
  m[1][1] = one - (x * x2 + z * z2);
  m[2][2] = one - (x * x2 + y * y2);
  m[0][1] = x * y2 - w * z2;
  m[1][0] = x * y2 + w * z2;
  m[0][2] = x * z2 + w * y2;
  m[2][0] = x * z2 - w * y2;
  m[1][2] = y * z2 - w * x2;
  m[2][1] = y * z2 + w * x2;
}

/// Computes the extents of spheres, boxes and capsules: all are a box widened by a radius. Those of hulls
/// get arbitrary values.
HWY_INLINE void compute_box_extents(const Batch& shapes, Rotations& rotations, Extents& out) {
  const Floats d;
  for (std::size_t i = 0; i < shapes.count; i += hn::Lanes(d)) {
    hn::Vec<Floats> orientation[4], size[4], m[3][3];
    gather_rows(
        d, [&](std::size_t lane) { return &shapes.at(i + lane).pose->orientation.x; }, orientation);
    gather_rows(
        d, [&](std::size_t lane) { return shapes.rows[shapes.at(i + lane).shape].size; }, size);
    compute_rotations(d, orientation, m);
    // Of these three kinds only a box has a third size. A capsule has its second size along its third axis.
    const auto box = hn::Gt(size[2], hn::Zero(d));
    const hn::Vec<Floats> half[3] = {hn::IfThenElseZero(box, size[0]), hn::IfThenElseZero(box, size[1]),
                                     hn::IfThenElse(box, size[2], size[1])};
    for (int a = 0; a < 3; ++a) {
      for (int j = 0; j < 3; ++j) hn::Store(m[a][j], d, rotations.entry[a][j] + i);
      const auto along = (hn::Abs(m[a][0]) * half[0] + hn::Abs(m[a][1]) * half[1]) + hn::Abs(m[a][2]) * half[2];
      hn::Store(hn::Neg(along), d, out.lower[a] + i);
      hn::Store(along, d, out.upper[a] + i);
    }
    hn::Store(hn::IfThenZeroElse(box, size[0]), d, out.radius + i);
    hn::Store(size[3], d, out.bounding_radius + i);
  }
}

/// Computes the extent of the i-th shape, a hull. The order of the reductions depends on the vector width, but the
/// result does not: a minimum or maximum is exact in any order.
HWY_INLINE void compute_hull_extent(const Hull& hull, const Rotations& rotations, std::size_t i, Extents& out) {
  const hn::CappedTag<float, hull_lanes> d;
  hn::Vec<decltype(d)> low[3], high[3];
  const auto extent = [&](int a, std::size_t v) HWY_ATTR {
    const auto part = [&](int j, const float* column)
                          HWY_ATTR { return hn::Set(d, rotations.entry[a][j][i]) * hn::Load(d, column + v); };
    return (part(0, hull.x()) + part(1, hull.y())) + part(2, hull.z());
  };
  for (int a = 0; a < 3; ++a) low[a] = high[a] = extent(a, 0);
  for (std::size_t v = hn::Lanes(d); v < hull.vertex_count(); v += hn::Lanes(d)) {
    for (int a = 0; a < 3; ++a) {
      const auto along = extent(a, v);
      low[a] = hn::Min(low[a], along);
      high[a] = hn::Max(high[a], along);
    }
  }
  float upper[4], lower[4];
  max_lanes_of_four(d, high[0], high[1], high[2], high[2], upper);
  max_lanes_of_four(d, hn::Neg(low[0]), hn::Neg(low[1]), hn::Neg(low[2]), hn::Neg(low[2]), lower);
  for (int a = 0; a < 3; ++a) {
    out.upper[a][i] = upper[a];
    out.lower[a][i] = -lower[a];
  }
  out.radius[i] = 0;
}

/// Computes the extents of a batch.
inline void compute_extents(const Batch& shapes, Extents& out) {
  Rotations rotations;
  compute_box_extents(shapes, rotations, out);
  // Listed first: a branch on the kind of each shape would be unpredictable.
  std::uint32_t hulls[batch];
  std::size_t hull_count = 0;
  for (std::size_t i = 0; i < shapes.count; ++i) {
    hulls[hull_count] = static_cast<std::uint32_t>(i);
    hull_count += shapes.hulls[shapes.placed[i].shape] != nullptr;
  }
  for (std::size_t k = 0; k < hull_count; ++k) {
    compute_hull_extent(*shapes.hulls[shapes.placed[hulls[k]].shape], rotations, hulls[k], out);
  }
}

}  // namespace ringfence::geometry::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#endif
