// The state of a block of pairs of two hulls while it goes through the steps of the test. Included once for each
// Highway target.

#if defined(RINGFENCE_NARROW_PHASE_HULL_PAIRS_INL) == defined(HWY_TARGET_TOGGLE)
#ifdef RINGFENCE_NARROW_PHASE_HULL_PAIRS_INL
#undef RINGFENCE_NARROW_PHASE_HULL_PAIRS_INL
#else
#define RINGFENCE_NARROW_PHASE_HULL_PAIRS_INL
#endif

#include <algorithm>
#include <cstddef>
#include <cstdint>

#include "narrow_phase/hull/hull_block-inl.hpp"

HWY_BEFORE_NAMESPACE();
namespace ringfence::narrow_phase::HWY_NAMESPACE {

/// Up to block_pairs pairs of hulls, at least one: what the steps of the test read, and the best direction so far.
///
/// Side 0 of a pair is its first hull, side 1 its second. Every formula but those of HullBounds is that of
/// PolytopePair<float>, operation by operation, so both give the same bits.
struct HullPairs {
  using D = Columns16<float>;
  using V = hn::Vec<D>;
  using Column3 = float[3][block_pairs];
  static constexpr D d{};
  static constexpr std::size_t lanes = hn::MaxLanes(D());

  HullPairs(const KernelInput& kernel_input, const KernelPair* pairs, std::size_t pair_count, WorkCounts& counts)
      : input(kernel_input), count(pair_count), work(counts) {
    set_zero(axis_overlap);
    set_zero(size);
    std::fill(std::copy_n(pairs, count, pair), pair + block_pairs, pairs[count - 1]);
    placed.fill<ShapeKind::hull, ShapeKind::hull>(input, pair, block_pairs);
    for (std::size_t i = 0; i < block_pairs; ++i) {
      hull[0][i] = &input.shapes.hull(input.shapes.row(input.bodies[pair[i].first].shape).index_in_kind);
      hull[1][i] = &input.shapes.hull(input.shapes.row(input.bodies[pair[i].second].shape).index_in_kind);
    }
  }

  /// The overlap of a pair along a unit direction, from the first to the second.
  HWY_INLINE float overlap_along(std::size_t i, Vec3f direction) const {
    return (support(0, i, direction) + support(1, i, -rotate_inverse(placed.rotation_of(i), direction))) -
           dot(direction, placed.offset_of(i));
  }
  /// The centroids of the hulls of pairs from `i` on, in their own axes.
  HWY_INLINE Vector<D> centroids(std::size_t side, std::size_t i) const {
    const auto column = [&](int k) HWY_ATTR {
      return hn::LoadU(d, (side == 0 ? placed.first_size(k) : placed.second_size(k)) + i);
    };
    return {column(0), column(1), column(2)};
  }
  HWY_INLINE float support(std::size_t side, std::size_t i, Vec3f direction) const {
    return hn::GetLane(hn::MaxOfLanes(d, highest(*hull[side][i], direction)));
  }

  /// Removes the pairs with a negative overlap from the undecided ones, and stores what separates them for the next
  /// frame. `direction_of(i)` is that direction, in the axes of the first hull.
  template <class Direction>
  HWY_INLINE void remove_separated(const Direction& direction_of) {
    undecided.keep([&](std::size_t i) HWY_ATTR {
      const bool separated = best[i] < 0;
      if (HWY_UNLIKELY(separated && input.memory != nullptr)) remember(i, direction_of(i));
      return !separated;
    });
  }
  AxisMemory::Key key_of(std::size_t i) const {
    return AxisMemory::key_of(input.bodies[pair[i].first].number, input.bodies[pair[i].second].number);
  }
  void remember(std::size_t i, Vec3f direction) const {
    const AxisMemory::Key key = key_of(i);
    (*input.memory)[key] = {key.tag, rotate(placed.get(i).first, direction)};
  }

  const KernelInput& input;
  const std::size_t count;
  WorkCounts& work;
  KernelPair pair[block_pairs];
  PlacementColumns placed;
  const geometry::Hull* hull[2][block_pairs];
  Undecided undecided;
  alignas(64) float best[block_pairs];  ///< the least overlap found
  alignas(64) Column3 best_direction;   ///< its direction, from the first to the second, in the axes of the first
  // Zero at first, since the lanes of decided pairs are computed too: leftovers on the stack could be slow to compute
  // with.
  alignas(64) float axis_overlap[block_pairs];  ///< along the line between the centres, times its length
  alignas(64) float size[block_pairs];          ///< the sum of the bounding radii
  // Points of the other hull in the axes of each side: the centre of its ball, and two of its vertices.
  alignas(64) Column3 ball[2], point[2][2];
};

}  // namespace ringfence::narrow_phase::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#endif
