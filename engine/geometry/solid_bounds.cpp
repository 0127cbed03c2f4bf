#include "geometry/solid_bounds.hpp"

#include <cstddef>
#include <cstdint>
#include <cstring>

#include "geometry/hull.hpp"
#include "geometry/outer_steps.hpp"
#include "geometry/vector.hpp"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "geometry/solid_bounds.cpp"
#include <hwy/foreach_target.h>
// Must follow foreach_target.h.
#include "geometry/max_lanes-inl.hpp"

HWY_BEFORE_NAMESPACE();
namespace ringfence::geometry::HWY_NAMESPACE {

namespace hn = hwy::HWY_NAMESPACE;

/// One value for each axis: x, y, z; the fourth is unused.
struct Axes {
  alignas(16) float at[4];
};

/// The extent of a shape along the world's axes, relative to the shape's origin.
struct AxisExtent {
  Axes lower, upper;
};

/// The columns of a rotation matrix: column j is shape axis j in world axes.
struct RotationColumns {
  Axes column[3];
};

#if HWY_TARGET == HWY_SCALAR

inline RotationColumns columns_of(Quat q) {
  const Rotation r = rotation(q);
  RotationColumns out;
  for (int j = 0; j < 3; ++j) out.column[j] = {{r.m[0][j], r.m[1][j], r.m[2][j], 0}};
  return out;
}

#else

/// Computes the same terms as rotation(), one column at a time and one entry in each lane: 1 - (p + q) on the diagonal,
/// p + q or p - q elsewhere, where p and q are the two products of the entry.
inline RotationColumns columns_of(Quat orientation) {
  const hn::FixedTag<float, 4> d;
  const hn::RebindToSigned<decltype(d)> ints;
  const hn::RebindToUnsigned<decltype(d)> bits;
  alignas(16) static constexpr std::int32_t first_p[3][4] = {{1, 0, 0, 3}, {0, 0, 1, 3}, {0, 1, 0, 3}};
  alignas(16) static constexpr std::int32_t second_p[3][4] = {{1, 1, 2, 3}, {1, 0, 2, 3}, {2, 2, 0, 3}};
  alignas(16) static constexpr std::int32_t first_q[3][4] = {{2, 3, 3, 3}, {3, 2, 3, 3}, {3, 3, 1, 3}};
  alignas(16) static constexpr std::int32_t second_q[3][4] = {{2, 2, 1, 3}, {2, 2, 0, 3}, {1, 0, 1, 3}};
  constexpr std::uint32_t minus = 0x80000000u;
  alignas(16) static constexpr std::uint32_t sign_q[3][4] = {{0, 0, minus, 0}, {minus, 0, 0, 0}, {0, minus, 0, 0}};
  alignas(16) static constexpr std::uint32_t diagonal[3][4] = {{minus, 0, 0, 0}, {0, minus, 0, 0}, {0, 0, minus, 0}};
  alignas(16) static constexpr float one[3][4] = {{1, 0, 0, 0}, {0, 1, 0, 0}, {0, 0, 1, 0}};
  const auto v = hn::LoadU(d, &orientation.x);
  const auto doubled = v + v;
  const auto select_lanes = [&](auto of, const std::int32_t* lanes) HWY_ATTR {
    return hn::TableLookupLanes(of, hn::IndicesFromVec(d, hn::Load(ints, lanes)));
  };
  const auto flip_signs = [&](auto of, const std::uint32_t* signs)
                              HWY_ATTR { return hn::Xor(of, hn::BitCast(d, hn::Load(bits, signs))); };
  RotationColumns out;
  for (int j = 0; j < 3; ++j) {
    const auto p = select_lanes(v, first_p[j]) * select_lanes(doubled, second_p[j]);
    const auto q = select_lanes(v, first_q[j]) * select_lanes(doubled, second_q[j]);
    const auto sum = p + flip_signs(q, sign_q[j]);
    hn::Store(flip_signs(sum, diagonal[j]) + hn::Load(d, one[j]), d, out.column[j].at);
  }
  return out;
}

#endif

using FloatTag = hn::CappedTag<float, 4>;
using DoubleTag = hn::CappedTag<double, 4>;

/// Half of the extent of a box with these half extents, along the world's axes.
inline Axes box_extent(const RotationColumns& shape_axes, const float half[3]) {
  const FloatTag d;
  Axes out;
  for (std::size_t i = 0; i < 4; i += hn::Lanes(d)) {
    const auto along = [&](int j)
                           HWY_ATTR { return hn::Abs(hn::Load(d, shape_axes.column[j].at + i)) * hn::Set(d, half[j]); };
    hn::Store((along(0) + along(1)) + along(2), d, out.at + i);
  }
  return out;
}

// The order of the reductions depends on the vector width, but the result does not: a minimum or maximum is exact in
// any order.
inline AxisExtent hull_extent(const Hull& hull, const RotationColumns& shape_axes) {
  const hn::CappedTag<float, hull_lanes> d;
  hn::Vec<decltype(d)> low[3], high[3];
  const auto extent = [&](int i, std::size_t v) HWY_ATTR {
    const auto part = [&](int j, const float* column)
                          HWY_ATTR { return hn::Set(d, shape_axes.column[j].at[i]) * hn::Load(d, column + v); };
    return (part(0, hull.x()) + part(1, hull.y())) + part(2, hull.z());
  };
  for (int i = 0; i < 3; ++i) low[i] = high[i] = extent(i, 0);
  for (std::size_t v = hn::Lanes(d); v < hull.vertex_count(); v += hn::Lanes(d)) {
    for (int i = 0; i < 3; ++i) {
      const auto along = extent(i, v);
      low[i] = hn::Min(low[i], along);
      high[i] = hn::Max(high[i], along);
    }
  }
  AxisExtent out;
  max_lanes_of_four(d, high[0], high[1], high[2], high[2], out.upper.at);
  max_lanes_of_four(d, hn::Neg(low[0]), hn::Neg(low[1]), hn::Neg(low[2]), hn::Neg(low[2]), out.lower.at);
  for (float& value : out.lower.at) value = -value;
  return out;
}

/// Replaces the steps outside the bounds by those of the octaves, with the bits of FixedSpace::Rows::outer_step().
template <class D>
HWY_INLINE hn::Vec<D> with_octaves(D d, hn::Vec<D> steps, hn::Vec<D> first, hn::Vec<D> last) {
  const hn::RebindToUnsigned<D> bits;
  const auto below = steps < first;
  const auto sides = hn::Set(d, 1.0) + hn::IfThenElse(below, first - steps, steps - last) * hn::Set(d, 1 / inner_steps);
  const auto whole = hn::ShiftRight<52 - octave_log2>(hn::BitCast(bits, sides));
  // The integer becomes the lowest bits of a double with the value 2^52 plus the integer.
  const auto beyond = hn::BitCast(d, hn::Or(whole, hn::Set(bits, 0x4330000000000000))) -
                      hn::Set(d, 0x1p52 + 1023.0 * (1 << octave_log2));
  const auto outer = hn::IfThenElse(below, first - beyond, last + beyond);
  return hn::IfThenElse(hn::Or(below, steps > last), outer, steps);
}

/// Rounds steps on as many axes as `d` has lanes up or down. Values outside the range saturate, and NaN becomes 0, as
/// in FixedSpace.
template <bool up, class D>
HWY_INLINE void store_steps(D d, hn::Vec<D> steps, std::int32_t* to) {
  const hn::Rebind<std::int32_t, D> words;
  const auto inside = hn::Min(hn::Max(steps, hn::Zero(d)), hn::Set(d, 4294967295.0));
  const auto whole = up ? hn::Ceil(inside) : hn::Floor(inside);
  // The conversion is to signed integers: subtract 2^31 before it, and flip the top bit after it.
  const auto half_below = hn::DemoteTo(words, whole - hn::Set(d, 2147483648.0));
  hn::Store(hn::Xor(half_below, hn::Set(words, INT32_MIN)), words, to);
}

/// The bounds of an extent at a pose. `radius` and `margin` widen the extent on all sides, in double precision. If
/// `point` is not null, the fixed-point position is stored there.
inline Bounds bounds_about(const Pose& pose, const AxisExtent& extent, double radius, double margin,
                           const FixedSpace::Rows& space, FixedPoint* point) {
  const DoubleTag d;
  const hn::Rebind<float, DoubleTag> narrow;
  // The load of the position also reads 8 bytes of the orientation, into the fourth lane. The mask clears them, because
  // as a double they may be denormal, and arithmetic on denormals is slow.
  alignas(32) static constexpr std::uint64_t first_three_lanes[4] = {~0ull, ~0ull, ~0ull, 0};
  const auto widening = hn::Set(d, margin), round = hn::Set(d, radius);
  alignas(16) std::int32_t lower[4], upper[4], point_steps[4];
  for (std::size_t i = 0; i < 4; i += hn::Lanes(d)) {
    const auto mask = hn::BitCast(d, hn::Load(hn::RebindToUnsigned<DoubleTag>(), first_three_lanes + i));
    const auto at = hn::And(hn::LoadU(d, &pose.position.x + i), mask);
    const auto min = hn::Load(d, space.min + i), scale = hn::Load(d, space.scale + i);
    const auto low = hn::PromoteTo(d, hn::Load(narrow, extent.lower.at + i)) - round;
    const auto high = hn::PromoteTo(d, hn::Load(narrow, extent.upper.at + i)) + round;
    auto low_steps = (at + (low - widening) - min) * scale;
    auto high_steps = (at + (high + widening) - min) * scale;
    auto at_steps = (at - min) * scale;
    const auto first = hn::Load(d, space.first + i), last = hn::Load(d, space.last + i);
    const auto outside = hn::Or(hn::Min(low_steps, at_steps) < first, hn::Max(high_steps, at_steps) > last);
    if (HWY_UNLIKELY(!hn::AllFalse(d, outside))) {
      low_steps = with_octaves(d, low_steps, first, last);
      high_steps = with_octaves(d, high_steps, first, last);
      at_steps = with_octaves(d, at_steps, first, last);
    }
    store_steps<false>(d, low_steps, lower + i);
    store_steps<true>(d, high_steps, upper + i);
    store_steps<false>(d, at_steps, point_steps + i);
  }
  if (point != nullptr) std::memcpy(point->at, point_steps, sizeof point_steps);
  const auto word = [](std::int32_t value) { return static_cast<std::uint32_t>(value); };
  return {{word(lower[0]), word(lower[1]), word(lower[2])}, {word(upper[0]), word(upper[1]), word(upper[2])}};
}

/// The extent from -half to +half.
inline AxisExtent symmetric(const Axes& half) {
  AxisExtent extent{half, half};
  for (float& value : extent.lower.at) value = -value;
  return extent;
}

/// The bounds of one shape at a pose. Spheres, boxes and capsules share one formula, that of a box widened by a radius,
/// so no branch depends on which of the three the shape is. `hull` is null for these.
HWY_INLINE Bounds bounds_of(const ShapeRow& row, const Hull* hull, const Pose& pose, const FixedSpace::Rows& space,
                            FixedPoint* point) {
  const double margin = rounding_margin * double{row.bounding_radius};
  const RotationColumns shape_axes = columns_of(pose.orientation);
  if (hull != nullptr) return bounds_about(pose, hull_extent(*hull, shape_axes), 0, margin, space, point);
  const bool box = row.kind == ShapeKind::box, capsule = row.kind == ShapeKind::capsule;
  const float half[3] = {box ? row.size[0] : 0, box ? row.size[1] : 0, capsule ? row.size[1] : row.size[2]};
  return bounds_about(pose, symmetric(box_extent(shape_axes, half)), box ? 0 : double{row.size[0]}, margin, space,
                      point);
}

void bounds_of_all(const PlacedShape* placed, const PlacedShape* end, const ShapeRow* rows, const Hull* const* hulls,
                   const FixedSpace::Rows& space, Bounds* out, FixedPoint* points) {
  for (; placed != end; ++placed, ++out) {
    *out = bounds_of(rows[placed->shape], hulls[placed->shape], *placed->pose, space, points);
    points += points != nullptr ? 1 : 0;
  }
}

}  // namespace ringfence::geometry::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace ringfence::geometry {

HWY_EXPORT(bounds_of_all);

void compute_solid_bounds(std::span<const PlacedShape> placed, const ShapeRow* rows, const Hull* const* hulls,
                          const FixedSpace& space, Bounds* out, FixedPoint* points) noexcept {
  HWY_DYNAMIC_DISPATCH(bounds_of_all)
  (placed.data(), placed.data() + placed.size(), rows, hulls, space.rows(), out, points);
}

}  // namespace ringfence::geometry
#endif
