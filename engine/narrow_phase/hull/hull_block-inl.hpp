// Shared by the kernels that test pairs with hulls in blocks. Included once for each Highway target.
//
// The test of a pair with a hull has about a dozen steps, each of which depends on the previous one and may end the
// test unpredictably. So all pairs of a block go through each step together: while one pair waits for a result, the
// next is computed, and a pair that is decided is removed from a list without a branch. Steps with a few numbers per
// pair are computed in lanes, one pair per lane.

#if defined(RINGFENCE_NARROW_PHASE_HULL_BLOCK_INL) == defined(HWY_TARGET_TOGGLE)
#ifdef RINGFENCE_NARROW_PHASE_HULL_BLOCK_INL
#undef RINGFENCE_NARROW_PHASE_HULL_BLOCK_INL
#else
#define RINGFENCE_NARROW_PHASE_HULL_BLOCK_INL
#endif

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <type_traits>

#include "geometry/max_lanes-inl.hpp"
#include "geometry/rows-inl.hpp"
#include "narrow_phase/hull/pair_kernel-inl.hpp"

HWY_BEFORE_NAMESPACE();
namespace ringfence::narrow_phase::HWY_NAMESPACE {

using geometry::HWY_NAMESPACE::gather_rows;

inline constexpr std::size_t block_pairs = PlacementColumns::most;

/// The pairs of a block that are not yet decided, ascending.
struct Undecided {
  std::uint32_t pair[block_pairs];
  std::size_t count = 0;

  /// The first `pairs` pairs.
  HWY_INLINE void fill(std::size_t pairs) {
    count = pairs;
    for (std::size_t i = 0; i < pairs; ++i) pair[i] = static_cast<std::uint32_t>(i);
  }
  /// Keeps the pairs for which `undecided(i)` is true, without a branch.
  template <class Test>
  HWY_INLINE void keep(const Test& undecided) {
    std::size_t kept = 0;
    for (std::size_t k = 0; k < count; ++k) {
      const std::uint32_t i = pair[k];
      const bool stays = undecided(i);
      pair[kept] = i;
      kept += stays;
    }
    count = kept;
  }
};

/// Writes zeros to a column of a block, or to an array of columns. With vector stores: for `= {}` the compiler emits a
/// string instruction, which took 3 % of the time of hulls that are apart.
template <class Columns>
HWY_INLINE void set_zero(Columns& columns) {
  using Element = std::remove_extent_t<Columns>;
  if constexpr (std::is_array_v<Element>) {
    for (Element& column : columns) set_zero(column);
  } else {
    const Columns16<Element> lanes;
    for (std::size_t i = 0; i < block_pairs; i += hn::Lanes(lanes)) hn::Store(hn::Zero(lanes), lanes, columns + i);
  }
}

/// Some pairs of a block.
struct PairList {
  std::size_t count = 0;
  std::uint32_t pair[block_pairs + 4];

  HWY_INLINE void add(std::uint32_t i, bool belongs) {
    pair[count] = i;
    count += belongs;
  }
  /// Adds `first` plus the index of each set bit.
  HWY_INLINE void add_bits(std::uint32_t bits, std::size_t first) { count = append_bits(bits, first, pair, count); }
};

/// The contacts of a block, in the axes of the first bodies and relative to their origins.
struct BlockContacts {
  alignas(64) float depth[block_pairs];
  alignas(64) float normal[3][block_pairs];
  alignas(64) float point[3][block_pairs];
  alignas(64) std::uint32_t hit[block_pairs];  ///< all bits set or none

  /// No contacts. The other columns are also read where there is none: leftovers on the stack could be denormal
  /// numbers, which are slow.
  HWY_INLINE void clear() {
    set_zero(depth);
    set_zero(normal);
    set_zero(point);
    set_zero(hit);
  }

  HWY_INLINE void put(std::size_t i, float its_depth, Vec3f n, Vec3f p) {
    depth[i] = its_depth;
    normal[0][i] = n.x;
    normal[1][i] = n.y;
    normal[2][i] = n.z;
    point[0][i] = p.x;
    point[1][i] = p.y;
    point[2][i] = p.z;
    hit[i] = ~0u;
  }

  /// Writes all columns but the normal for the lanes of `mask`, and marks the other lanes as no hits.
  template <class D>
  HWY_INLINE void put_lanes(D d, std::size_t i, hn::Mask<D> mask, hn::Vec<D> its_depth, const Vector<D>& p) {
    const hn::RebindToUnsigned<D> bits;
    hn::Store(its_depth, d, depth + i);
    hn::Store(p.x, d, point[0] + i);
    hn::Store(p.y, d, point[1] + i);
    hn::Store(p.z, d, point[2] + i);
    hn::Store(hn::VecFromMask(bits, hn::RebindMask(bits, mask)), bits, hit + i);
  }
};

template <class D>
HWY_INLINE Vector<D> load(D d, const float (&columns)[3][block_pairs], std::size_t i) {
  return {hn::Load(d, columns[0] + i), hn::Load(d, columns[1] + i), hn::Load(d, columns[2] + i)};
}

template <class D>
HWY_INLINE void store(D d, const Vector<D>& v, float (&columns)[3][block_pairs], std::size_t i) {
  hn::Store(v.x, d, columns[0] + i);
  hn::Store(v.y, d, columns[1] + i);
  hn::Store(v.z, d, columns[2] + i);
}

HWY_INLINE Vec3f at(const float (&columns)[3][block_pairs], std::size_t i) {
  return {columns[0][i], columns[1][i], columns[2][i]};
}
HWY_INLINE void put(Vec3f v, float (&to)[3][block_pairs], std::size_t i) {
  to[0][i] = v.x;
  to[1][i] = v.y;
  to[2][i] = v.z;
}

/// The lanes' greatest distances of a hull's vertices along a direction.
HWY_INLINE hn::Vec<Columns16<float>> highest(const geometry::Hull& of, Vec3f direction) {
  const Columns16<float> d;
  const float *const x = of.x(), *const y = of.y(), *const z = of.z();
  const auto direction_lanes = spread_out(d, direction);
  auto most = dot_of(d, read(d, x, y, z), direction_lanes);
  for (std::size_t v = hn::Lanes(d); v < of.vertex_count(); v += hn::Lanes(d)) {
    most = hn::Max(most, dot_of(d, read(d, x + v, y + v, z + v), direction_lanes));
  }
  return most;
}

/// Calls `visit(k, most)` with the greatest lane of each of `count` vectors: four are reduced together, the rest one at
/// a time, since a block may have few.
template <class Lanes, class Visit>
HWY_INLINE void for_each_greatest(std::size_t count, const Lanes& lanes_of, const Visit& visit) {
  const Columns16<float> d;
  std::size_t k = 0;
  for (; k + 4 <= count; k += 4) {
    float most[4];
    const auto first = lanes_of(k), second = lanes_of(k + 1), third = lanes_of(k + 2), fourth = lanes_of(k + 3);
    geometry::HWY_NAMESPACE::max_lanes_of_four(d, first, second, third, fourth, most);
    for (std::size_t m = 0; m < 4; ++m) visit(k + m, most[m]);
  }
  for (; k < count; ++k) visit(k, hn::GetLane(hn::MaxOfLanes(d, lanes_of(k))));
}

template <ShapeKind a, ShapeKind b>
struct KindsOf {
  static constexpr ShapeKind first = a, second = b;
};

/// Writes the contacts of a block. `pairs` must have (arbitrary) entries up to the end of the last vector.
template <class Kinds, class D>
HWY_INLINE PairContact* write_block(D d, const KernelPair* pairs, std::size_t count, const PlacementColumns& placed,
                                    const BlockContacts& found, PairContact* out) {
  for (std::size_t i = 0; i < count; i += hn::MaxLanes(D())) {
    const auto column = [&](const float* c) HWY_ATTR { return hn::LoadU(d, c + i); };
    Rotation<D> first;
    for (int k = 0; k < 3; ++k) {
      for (int j = 0; j < 3; ++j) first.m[k][j] = column(placed.first(k, j));
    }
    const hn::RebindToUnsigned<D> bits;
    const auto hit = hn::MaskFromVec(hn::BitCast(d, hn::Load(bits, found.hit + i)));
    const LaneContacts<D> world{hit, hn::Load(d, found.depth + i), rotate(d, first, load(d, found.normal, i)),
                                rotate(d, first, load(d, found.point, i))};
    const Vector<D> offset{column(placed.world(0)), column(placed.world(1)), column(placed.world(2))};
    out = write<Kinds>(d, ids_of(d, pairs + i), std::min(count - i, hn::MaxLanes(D())), world, offset, out);
  }
  return out;
}

}  // namespace ringfence::narrow_phase::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#endif
