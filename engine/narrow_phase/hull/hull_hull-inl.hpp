// Hulls against hulls, in blocks of pairs. Included once for each Highway target.

#if defined(RINGFENCE_NARROW_PHASE_HULL_HULL_INL) == defined(HWY_TARGET_TOGGLE)
#ifdef RINGFENCE_NARROW_PHASE_HULL_HULL_INL
#undef RINGFENCE_NARROW_PHASE_HULL_HULL_INL
#else
#define RINGFENCE_NARROW_PHASE_HULL_HULL_INL
#endif

#include <algorithm>
#include <cstddef>

#include "narrow_phase/hull/hull_contacts-inl.hpp"
#include "narrow_phase/hull/hull_edge_pairs-inl.hpp"
#include "narrow_phase/hull/hull_faces-inl.hpp"

HWY_BEFORE_NAMESPACE();
namespace ringfence::narrow_phase::HWY_NAMESPACE {

#if HWY_TARGET == HWY_SCALAR

/// Without vectors a block gains nothing.
inline PairContact* hull_hull_in_blocks(const KernelInput& input, PairContact* out, KindCounters& counters) {
  return run_in_float<HullSource, HullSource>(input, out, counters);
}

#else

/// Tests all pairs of a block step by step: see hull_block-inl.hpp. The results are those of PolytopePair<float>.
inline PairContact* hull_hull_in_blocks(const KernelInput& input, PairContact* out, KindCounters& counters) {
  WorkCounts work;
  for (std::size_t begin = 0; begin < input.pairs.size(); begin += block_pairs) {
    begin_gathering(input);
    HullPairs pairs(input, input.pairs.data() + begin, std::min(block_pairs, input.pairs.size() - begin), work);
    end_gathering(input);
    HullBounds bounds(pairs);
    HullFaces(pairs, bounds).run();
    if (pairs.undecided.count == 0) continue;
    HullEdgePairs edges(pairs, bounds);
    edges.run();
    BlockContacts found;
    found.clear();
    HullContacts(pairs, found).run(edges.left_over());
    out = write_block<KindsOf<ShapeKind::hull, ShapeKind::hull> >(HullPairs::d, pairs.pair, pairs.count, pairs.placed,
                                                                  found, out);
  }
  work.add_to(counters);
  return out;
}

#endif

}  // namespace ringfence::narrow_phase::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#endif
