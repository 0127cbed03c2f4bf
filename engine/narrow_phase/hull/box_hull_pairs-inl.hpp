// The state of a block of pairs of a box and a hull while it goes through the steps of the test. Included once for each
// Highway target.

#if defined(RINGFENCE_NARROW_PHASE_BOX_HULL_PAIRS_INL) == defined(HWY_TARGET_TOGGLE)
#ifdef RINGFENCE_NARROW_PHASE_BOX_HULL_PAIRS_INL
#undef RINGFENCE_NARROW_PHASE_BOX_HULL_PAIRS_INL
#else
#define RINGFENCE_NARROW_PHASE_BOX_HULL_PAIRS_INL
#endif

#include <algorithm>
#include <cstddef>
#include <cstdint>

#include "narrow_phase/hull/hull_block-inl.hpp"

HWY_BEFORE_NAMESPACE();
namespace ringfence::narrow_phase::HWY_NAMESPACE {

/// Up to block_pairs pairs of a box and a hull, at least one: what the steps of the test read, and the best direction
/// so far. At first all are undecided. Everything is in the axes of the box, relative to its centre, unless it says
/// otherwise.
struct BoxHullPairs {
  using D = Columns16<float>;
  using V = hn::Vec<D>;
  using Column3 = float[3][block_pairs];
  static constexpr D d{};
  static constexpr std::size_t lanes = hn::MaxLanes(D());

  BoxHullPairs(const KernelInput& kernel_input, const KernelPair* pairs, std::size_t pair_count, WorkCounts& counts)
      : input(kernel_input), count(pair_count), work(counts) {
    std::fill(std::copy_n(pairs, count, pair), pair + block_pairs, pairs[count - 1]);
    placed.fill<ShapeKind::box, ShapeKind::hull>(input, pair, block_pairs);
    for (std::size_t i = 0; i < block_pairs; ++i) {
      hull[i] = &input.shapes.hull(input.shapes.row(input.bodies[pair[i].second].shape).index_in_kind);
    }
    undecided.fill(count);
  }

  HWY_INLINE V half(int k, std::size_t i) const { return hn::LoadU(d, placed.first_size(k) + i); }
  HWY_INLINE Vector<D> half_lanes(std::size_t i) const { return {half(0, i), half(1, i), half(2, i)}; }
  HWY_INLINE V offset(int k, std::size_t i) const { return hn::LoadU(d, placed.offset(k) + i); }
  /// The centroids of the hulls.
  HWY_INLINE Vector<D> hull_centres(std::size_t i) const {
    const Vector<D> in_hull{hn::LoadU(d, placed.second_size(0) + i), hn::LoadU(d, placed.second_size(1) + i),
                            hn::LoadU(d, placed.second_size(2) + i)};
    return add(d, rotate(d, placed.rotation_lanes(d, i), in_hull), placed.offset_lanes(d, i));
  }
  HWY_INLINE const geometry::ShapeRow& box(std::size_t i) const {
    return input.shapes.row(input.bodies[pair[i].first].shape);
  }

  const KernelInput& input;
  const std::size_t count;
  WorkCounts& work;
  KernelPair pair[block_pairs];
  PlacementColumns placed;
  const geometry::Hull* hull[block_pairs];
  Undecided undecided;
  alignas(64) float best[block_pairs];  ///< the least overlap found
  alignas(64) Column3 best_direction;   ///< its direction, from box to hull; unit but for rounding
  alignas(64) float size[block_pairs];  ///< the sum of the two bounding radii
  std::uint32_t doubtful = 0;           ///< one bit per pair: rounding could decide it wrongly
};

}  // namespace ringfence::narrow_phase::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#endif
