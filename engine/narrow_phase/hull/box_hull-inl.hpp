// Boxes against hulls, in blocks of pairs. Included once for each Highway target.
//
// The least overlap is along the normal of a face of the box, the normal of a face of the hull, or a direction across
// one edge of each shape whose arcs of normals cross (as for any two polytopes: see polytope_pair-inl.hpp). The support
// of a box needs no search: it is |n| · half extents in the box's own axes. So the overlap along all face normals of
// the hull is bounded in one pass. The bounds exclude most faces and most edges; see the class of each step.
//
// PolytopePair tests a pair again, alone, where rounding could decide wrongly: edges are nearly parallel, arcs nearly
// miss each other, the depth differs from the least overlap, or the contact point lies outside a shape.

#if defined(RINGFENCE_NARROW_PHASE_BOX_HULL_INL) == defined(HWY_TARGET_TOGGLE)
#ifdef RINGFENCE_NARROW_PHASE_BOX_HULL_INL
#undef RINGFENCE_NARROW_PHASE_BOX_HULL_INL
#else
#define RINGFENCE_NARROW_PHASE_BOX_HULL_INL
#endif

#include <algorithm>
#include <cstddef>

#include "narrow_phase/hull/box_hull_contacts-inl.hpp"
#include "narrow_phase/hull/box_hull_edges-inl.hpp"
#include "narrow_phase/hull/box_hull_faces-inl.hpp"

HWY_BEFORE_NAMESPACE();
namespace ringfence::narrow_phase::HWY_NAMESPACE {

/// Tests the undecided pairs of a block step by step: see hull_block-inl.hpp.
inline PairContact* test_block(BoxHullPairs& pairs, PairContact* out) {
  if (pairs.undecided.count == 0) return out;
  BoxHullBounds bounds(pairs);
  BoxHullFaces(pairs, bounds).run();
  if (pairs.undecided.count == 0) return out;
  BoxHullEdges(pairs, bounds).run();
  BlockContacts found;
  BoxHullContacts(pairs, found).run();
  return write_block<KindsOf<ShapeKind::box, ShapeKind::hull>>(BoxHullPairs::d, pairs.pair, pairs.count, pairs.placed,
                                                               found, out);
}

/// Tests all pairs. Those that the line between their centres does not separate are collected and read again in full
/// blocks, because many further steps take as long for a few pairs of a block as for all. A block is tested as it is if
/// it is the only one, or full.
inline PairContact* box_hull(const KernelInput& input, PairContact* out, KindCounters& counters) {
  if (input.in_double) return run_in_double<BoxSource, HullSource>(input, out, counters);
  WorkCounts work;
  KernelPair collected[2 * block_pairs];
  std::size_t count = 0;
  const auto test_collected = [&](std::size_t tested) HWY_ATTR {
    BoxHullPairs pairs(input, collected, tested, work);
    out = test_block(pairs, out);
    count -= tested;
    std::copy_n(collected + tested, count, collected);
  };
  for (std::size_t begin = 0; begin < input.pairs.size(); begin += block_pairs) {
    const std::size_t rest = input.pairs.size() - begin;
    begin_gathering(input);
    BoxHullPairs pairs(input, input.pairs.data() + begin, std::min(block_pairs, rest), work);
    end_gathering(input);
    separate_by_centres(pairs);
    if (count == 0 && (rest <= block_pairs || pairs.undecided.count == block_pairs)) {
      out = test_block(pairs, out);
      continue;
    }
    for (std::size_t u = 0; u < pairs.undecided.count; ++u) collected[count++] = pairs.pair[pairs.undecided.pair[u]];
    if (count >= block_pairs) test_collected(block_pairs);
  }
  if (count > 0) test_collected(count);
  work.add_to(counters);
  return out;
}

}  // namespace ringfence::narrow_phase::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#endif
