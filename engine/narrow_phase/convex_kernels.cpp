#include "narrow_phase/kernel.hpp"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "narrow_phase/convex_kernels.cpp"
#include <hwy/foreach_target.h>
// After foreach_target.h.
#include "narrow_phase/convex_pair-inl.hpp"
#include "narrow_phase/convex_round-inl.hpp"

HWY_BEFORE_NAMESPACE();
namespace ringfence::narrow_phase::HWY_NAMESPACE {

/// A capsule, or a sphere as one of no height, first and a hull second; worked out in the axes of the hull.
template <class T, bool segment>
HWY_INLINE Answer test_round(const KernelInput& input, const KernelPair& pair, float radius, float half_height,
                             PairContact*& out, KindCounters& counters) {
  begin_gathering(input);
  const Body& round = input.bodies[pair.first];
  const Body& body = input.bodies[pair.second];
  const Polytope hull = polytope_of(input.shapes.hull(input.shapes.row(body.shape).detail));
  const Turn<T> turn = turn_of<T>(body.pose.orientation);
  const Point<T> offset = difference_of<T>(body.pose.position, round.pose.position);
  const Point<T> centre = -rotate_back(turn, offset);
  Point<T> from = centre, to = centre;
  if (segment && half_height > 0) {
    const Turn<T> own = turn_of<T>(round.pose.orientation);
    const Point<T> half = rotate_back(turn, Point<T>{own.m[0][2], own.m[1][2], own.m[2][2]}) * T(half_height);
    from = centre - half;
    to = centre + half;
  }
  end_gathering(input);
  RoundPair<T, segment> core(hull, from, to, T(radius));
  Overlap<T> found;
  const Answer answer = core.test(found);
  core.work().add_to(counters);
  if (answer == Answer::contact) {
    // About the hull's origin so far: to the round body's, which comes first.
    found.point = found.point - centre;
    out = write(pair, turn, offset, found, out);
  }
  return answer;
}

template <bool segment>
HWY_INLINE PairContact* run_round(const KernelInput& input, PairContact* out, KindCounters& counters) {
  for (const KernelPair& pair : input.pairs) {
    const geometry::ShapeRow& row = input.shapes.row(input.bodies[pair.first].shape);
    const float half_height = segment ? row.size[1] : 0.0f;
    if (input.in_double ||
        test_round<float, segment>(input, pair, row.size[0], half_height, out, counters) == Answer::unsure) {
      test_round<double, segment>(input, pair, row.size[0], half_height, out, counters);
    }
  }
  return out;
}

PairContact* sphere_hull(const KernelInput& input, PairContact* out, KindCounters& counters) {
  return run_round<false>(input, out, counters);
}
PairContact* capsule_hull(const KernelInput& input, PairContact* out, KindCounters& counters) {
  return run_round<true>(input, out, counters);
}

PairContact* hull_hull(const KernelInput& input, PairContact* out, KindCounters& counters) {
  return input.in_double ? run_in_double<FromHull, FromHull>(input, out, counters)
                         : run_in_float<FromHull, FromHull>(input, out, counters);
}

}  // namespace ringfence::narrow_phase::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace ringfence::narrow_phase {

HWY_EXPORT(hull_hull);
HWY_EXPORT(sphere_hull);
HWY_EXPORT(capsule_hull);

PairContact* test_hull_hull(const KernelInput& input, PairContact* out, KindCounters& counters) {
  return HWY_DYNAMIC_DISPATCH(hull_hull)(input, out, counters);
}
PairContact* test_sphere_hull(const KernelInput& input, PairContact* out, KindCounters& counters) {
  return HWY_DYNAMIC_DISPATCH(sphere_hull)(input, out, counters);
}
PairContact* test_capsule_hull(const KernelInput& input, PairContact* out, KindCounters& counters) {
  return HWY_DYNAMIC_DISPATCH(capsule_hull)(input, out, counters);
}

}  // namespace ringfence::narrow_phase
#endif
