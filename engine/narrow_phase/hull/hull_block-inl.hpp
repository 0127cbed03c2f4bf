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

#include "narrow_phase/hull/pair_kernel-inl.hpp"

HWY_BEFORE_NAMESPACE();
namespace ringfence::narrow_phase::HWY_NAMESPACE {

inline constexpr std::size_t block_pairs = PlacementColumns::most;

/// The pairs of a block that are not yet decided, ascending.
struct Undecided {
  std::uint32_t pair[block_pairs];
  std::size_t count = 0;

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

/// The contacts of a block, in the axes of the first bodies and relative to their origins.
struct BlockContacts {
  // Initialised also where there is no contact: leftovers on the stack could be denormal numbers, which are slow.
  alignas(64) float depth[block_pairs] = {};
  alignas(64) float normal[3][block_pairs] = {};
  alignas(64) float point[3][block_pairs] = {};
  alignas(64) std::uint32_t hit[block_pairs] = {};  ///< all bits set or none

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
    out = write<Kinds>(d, pairs + i, std::min(count - i, hn::MaxLanes(D())), world, offset, out);
  }
  return out;
}

}  // namespace ringfence::narrow_phase::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#endif
