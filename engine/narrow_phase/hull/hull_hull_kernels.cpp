#include "narrow_phase/kernel.hpp"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "narrow_phase/hull/hull_hull_kernels.cpp"
#include <hwy/foreach_target.h>
// After foreach_target.h.
#include "narrow_phase/hull/hull_hull-inl.hpp"

HWY_BEFORE_NAMESPACE();
namespace ringfence::narrow_phase::HWY_NAMESPACE {

PairContact* hull_hull(const KernelInput& input, PairContact* out, KindCounters& counters) {
  return input.in_double ? run_in_double<HullSource, HullSource>(input, out, counters)
                         : hull_hull_in_blocks(input, out, counters);
}

}  // namespace ringfence::narrow_phase::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace ringfence::narrow_phase {

HWY_EXPORT(hull_hull);

PairContact* test_hull_hull(const KernelInput& input, PairContact* out, KindCounters& counters) {
  return HWY_DYNAMIC_DISPATCH(hull_hull)(input, out, counters);
}

}  // namespace ringfence::narrow_phase
#endif
