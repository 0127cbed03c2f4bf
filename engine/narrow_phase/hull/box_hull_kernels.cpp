#include "narrow_phase/kernel.hpp"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "narrow_phase/hull/box_hull_kernels.cpp"
#include <hwy/foreach_target.h>
// After foreach_target.h.
#include "narrow_phase/hull/box_hull-inl.hpp"

#if HWY_ONCE
namespace ringfence::narrow_phase {

HWY_EXPORT(box_hull);

PairContact* test_box_hull(const KernelInput& input, PairContact* out, KindCounters& counters) {
  return HWY_DYNAMIC_DISPATCH(box_hull)(input, out, counters);
}

}  // namespace ringfence::narrow_phase
#endif
