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

/// Tests all pairs of a block step by step: see hull_block-inl.hpp.
inline PairContact* box_hull(const KernelInput& input, PairContact* out, KindCounters& counters) {
  if (input.in_double) return run_in_double<BoxSource, HullSource>(input, out, counters);
  WorkCounts work;
  for (std::size_t begin = 0; begin < input.pairs.size(); begin += block_pairs) {
    begin_gathering(input);
    BoxHullPairs pairs(input, input.pairs.data() + begin, std::min(block_pairs, input.pairs.size() - begin), work);
    end_gathering(input);
    BoxHullBounds bounds(pairs);
    BoxHullFaces(pairs, bounds).run();
    if (pairs.undecided.count == 0) continue;
    BoxHullEdges(pairs, bounds).run();
    BlockContacts found;
    BoxHullContacts(pairs, found).run();
    out = write_block<KindsOf<ShapeKind::box, ShapeKind::hull>>(BoxHullPairs::d, pairs.pair, pairs.count, pairs.placed,
                                                                found, out);
  }
  work.add_to(counters);
  return out;
}

}  // namespace ringfence::narrow_phase::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#endif
