#include "narrow_phase/kernel.hpp"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "narrow_phase/hull/round_hull_kernels.cpp"
#include <hwy/foreach_target.h>
// After foreach_target.h.
#include "narrow_phase/hull/round_hull-inl.hpp"

HWY_BEFORE_NAMESPACE();
namespace ringfence::narrow_phase::HWY_NAMESPACE {

/// Tests the pairs one by one.
template <bool segment>
PairContact* run_round_in_double(const KernelInput& input, PairContact* out, KindCounters& counters) {
  for (const KernelPair& pair : input.pairs) {
    begin_gathering(input);
    const Body& round = input.bodies[pair.first];
    const Body& body = input.bodies[pair.second];
    const geometry::ShapeRow& row = input.shapes.row(round.shape);
    const Polytope hull = polytope_of(input.shapes.hull(input.shapes.row(body.shape).index_in_kind));
    const RoundPlacement<double> placed(round.pose, body.pose, segment ? row.size[1] : 0.0f);
    end_gathering(input);
    RoundPair<double, segment> core(hull, placed.from, placed.to, double{row.size[0]});
    Overlap<double> found;
    const Decision answer = core.test(found);
    core.work().add_to(counters);
    if (answer != Decision::contact) continue;
    found.point = found.point - placed.centre;
    out = write(pair, placed.to_world, placed.offset, found, out);
  }
  return out;
}

template <bool segment>
HWY_INLINE PairContact* run_round(const KernelInput& input, PairContact* out, KindCounters& counters) {
  if (input.in_double) return run_round_in_double<segment>(input, out, counters);
  WorkCounts work;
  for (std::size_t begin = 0; begin < input.pairs.size(); begin += block_pairs) {
    begin_gathering(input);
    RoundHullBlock<segment> block(input, input.pairs.data() + begin, std::min(block_pairs, input.pairs.size() - begin),
                                  work);
    end_gathering(input);
    out = block.test(out);
  }
  work.add_to(counters);
  return out;
}

PairContact* sphere_hull(const KernelInput& input, PairContact* out, KindCounters& counters) {
  return run_round<false>(input, out, counters);
}
PairContact* capsule_hull(const KernelInput& input, PairContact* out, KindCounters& counters) {
  return run_round<true>(input, out, counters);
}

}  // namespace ringfence::narrow_phase::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace ringfence::narrow_phase {

HWY_EXPORT(sphere_hull);
HWY_EXPORT(capsule_hull);

PairContact* test_sphere_hull(const KernelInput& input, PairContact* out, KindCounters& counters) {
  return HWY_DYNAMIC_DISPATCH(sphere_hull)(input, out, counters);
}
PairContact* test_capsule_hull(const KernelInput& input, PairContact* out, KindCounters& counters) {
  return HWY_DYNAMIC_DISPATCH(capsule_hull)(input, out, counters);
}

}  // namespace ringfence::narrow_phase
#endif
