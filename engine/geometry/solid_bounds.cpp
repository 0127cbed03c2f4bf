#include "geometry/solid_bounds.hpp"

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <cstring>

#include "geometry/outer_steps.hpp"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "geometry/solid_bounds.cpp"
#include <hwy/foreach_target.h>
// Must follow foreach_target.h.
#include "geometry/rows-inl.hpp"
#include "geometry/solid_extents-inl.hpp"

HWY_BEFORE_NAMESPACE();
namespace ringfence::geometry::HWY_NAMESPACE {

namespace hn = hwy::HWY_NAMESPACE;

using Doubles = hn::CappedTag<double, 8>;
using Words = hn::CappedTag<std::uint32_t, 8>;

/// One number for each object of a batch.
using WordColumn = std::uint32_t[batch];

/// Bounds and positions in fixed point.
struct Steps {
  alignas(64) WordColumn lower[3], upper[3], point[3];
};

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

/// Rounds steps up or down. Values outside the range saturate, and NaN becomes 0, as in FixedSpace.
template <bool up>
HWY_INLINE void store_steps(Doubles d, hn::Vec<Doubles> steps, std::uint32_t* to) {
  const hn::Rebind<std::int32_t, Doubles> ints;
  const hn::RebindToUnsigned<decltype(ints)> words;
  const auto inside = hn::Min(hn::Max(steps, hn::Zero(d)), hn::Set(d, 4294967295.0));
  const auto whole = up ? hn::Ceil(inside) : hn::Floor(inside);
  // The conversion is to signed integers: subtract 2^31 before it, and flip the top bit after it.
  const auto half_below = hn::DemoteTo(ints, whole - hn::Set(d, 2147483648.0));
  hn::Store(hn::BitCast(words, hn::Xor(half_below, hn::Set(ints, INT32_MIN))), words, to);
}

/// The positions of as many objects as there are lanes: `position(lane)` points to three doubles, and 8 more bytes can
/// be read.
template <class Position>
HWY_INLINE void gather_positions(Doubles d, const Position& position, hn::Vec<Doubles>* out) {
#if HWY_TARGET == HWY_SCALAR
  for (int a = 0; a < 3; ++a) out[a] = hn::Set(d, position(0)[a]);
#else
  // Blocks of two doubles, of the objects with even and with odd numbers.
  const hn::Repartition<float, Doubles> floats;
  const auto blocks = [&](std::size_t first, std::size_t parity) HWY_ATTR {
    const auto row = [&](std::size_t lane)
                         HWY_ATTR { return reinterpret_cast<const float*>(position(lane / 2 + parity) + first); };
    return hn::BitCast(d, join_rows(floats, row, 0));
  };
  const auto even = blocks(0, 0), odd = blocks(0, 1);
  out[0] = hn::InterleaveLower(d, even, odd);
  out[1] = hn::InterleaveUpper(d, even, odd);
  out[2] = hn::InterleaveLower(d, blocks(2, 0), blocks(2, 1));
#endif
}

/// Computes the steps of as many objects as there are lanes, from the i-th on. The extents are widened in double.
HWY_INLINE void compute_steps(const Batch& shapes, std::size_t i, const Extents& extents, const FixedSpace::Rows& space,
                              Steps& out) {
  const Doubles d;
  const hn::Rebind<float, Doubles> narrow;
  const auto in_double = [&](const FloatColumn& column)
                             HWY_ATTR { return hn::PromoteTo(d, hn::Load(narrow, column + i)); };
  const auto widening = hn::Set(d, rounding_margin) * in_double(extents.bounding_radius),
             radius = in_double(extents.radius);
  hn::Vec<Doubles> position[3];
  gather_positions(
      d, [&](std::size_t lane) { return &shapes.at(i + lane).pose->position.x; }, position);
  for (int a = 0; a < 3; ++a) {
    const auto at = position[a], min = hn::Set(d, space.min[a]), scale = hn::Set(d, space.scale[a]);
    const auto low = in_double(extents.lower[a]) - radius, high = in_double(extents.upper[a]) + radius;
    auto low_steps = (at + (low - widening) - min) * scale;
    auto high_steps = (at + (high + widening) - min) * scale;
    auto at_steps = (at - min) * scale;
    const auto first = hn::Set(d, space.first[a]), last = hn::Set(d, space.last[a]);
    const auto outside = hn::Or(hn::Min(low_steps, at_steps) < first, hn::Max(high_steps, at_steps) > last);
    if (HWY_UNLIKELY(!hn::AllFalse(d, outside))) {
      low_steps = with_octaves(d, low_steps, first, last);
      high_steps = with_octaves(d, high_steps, first, last);
      at_steps = with_octaves(d, at_steps, first, last);
    }
    store_steps<false>(d, low_steps, out.lower[a] + i);
    store_steps<true>(d, high_steps, out.upper[a] + i);
    store_steps<false>(d, at_steps, out.point[a] + i);
  }
}

/// Writes the bounds, and the positions if `points` is not null, of the objects from `i` on, at most as many as there
/// are lanes.
HWY_INLINE void write(const Steps& steps, std::size_t i, std::size_t count, Bounds* out, FixedPoint* points) {
#if HWY_TARGET == HWY_SCALAR
  (void)count;
  for (int a = 0; a < 3; ++a) {
    out[i].lower[a] = steps.lower[a][i];
    out[i].upper[a] = steps.upper[a][i];
    if (points != nullptr) points[i].at[a] = steps.point[a][i];
  }
  if (points != nullptr) points[i].at[3] = 0;
#else
  const Words d;
  constexpr std::size_t lanes = hn::MaxLanes(Words());
  const auto load = [&](const WordColumn& column) HWY_ATTR { return hn::Load(d, column + i); };
  // Row r of a transposed matrix has one object in each block of four lanes: r, r + 4 and so on.
  alignas(64) std::uint32_t rows[4][lanes], ends[2][lanes], point_rows[4][lanes];
  const auto store_rows = [&](hn::Vec<Words> a, hn::Vec<Words> b, hn::Vec<Words> c, hn::Vec<Words> e,
                              std::uint32_t(&to)[4][lanes]) HWY_ATTR {
    hn::Vec<Words> transposed[4];
    transpose(d, a, b, c, e, transposed);
    for (int r = 0; r < 4; ++r) hn::Store(transposed[r], d, to[r]);
  };
  const auto y = load(steps.upper[1]), z = load(steps.upper[2]);
  store_rows(load(steps.lower[0]), load(steps.lower[1]), load(steps.lower[2]), load(steps.upper[0]), rows);
  hn::Store(hn::InterleaveLower(d, y, z), d, ends[0]);
  hn::Store(hn::InterleaveUpper(d, y, z), d, ends[1]);
  if (points != nullptr) {
    store_rows(load(steps.point[0]), load(steps.point[1]), load(steps.point[2]), hn::Zero(d), point_rows);
  }
  for (std::size_t k = 0; k < std::min(lanes, count); ++k) {
    const std::size_t block = k / 4 * 4;
    char* const to = reinterpret_cast<char*>(out + i + k);
    std::memcpy(to, rows[k % 4] + block, 16);
    std::memcpy(to + 16, ends[k % 4 / 2] + block + k % 2 * 2, 8);
    if (points != nullptr) std::memcpy(points[i + k].at, point_rows[k % 4] + block, 16);
  }
#endif
}

/// Computes the bounds of a batch, step by step.
void bounds_of_batch(const Batch& shapes, const FixedSpace::Rows& space, Bounds* out, FixedPoint* points) {
  Extents extents;
  Steps steps;
  compute_extents(shapes, extents);
  for (std::size_t i = 0; i < shapes.count; i += hn::Lanes(Doubles())) compute_steps(shapes, i, extents, space, steps);
  for (std::size_t i = 0; i < shapes.count; i += hn::Lanes(Words())) {
    write(steps, i, shapes.count - i, out, points);
  }
}

void bounds_of_all(const PlacedShape* placed, const PlacedShape* end, const ShapeRow* rows, const Hull* const* hulls,
                   const FixedSpace::Rows& space, Bounds* out, FixedPoint* points) {
  while (placed != end) {
    const std::size_t count = std::min(batch, static_cast<std::size_t>(end - placed));
    bounds_of_batch({placed, count, rows, hulls}, space, out, points);
    placed += count;
    out += count;
    if (points != nullptr) points += count;
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
