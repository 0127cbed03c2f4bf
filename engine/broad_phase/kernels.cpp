#include "broad_phase/kernels.hpp"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "broad_phase/kernels.cpp"
#include <hwy/foreach_target.h>
// These must follow foreach_target.h, which includes this file once for each target.
#include "broad_phase/classifying-inl.hpp"
#include "broad_phase/querying-inl.hpp"
#include "broad_phase/sorting-inl.hpp"
#include "broad_phase/staging-inl.hpp"
#include "broad_phase/sweeping-inl.hpp"

HWY_BEFORE_NAMESPACE();
namespace ringfence::broad_phase::HWY_NAMESPACE {

Kernels kernels() { return {classify_slots, stage, sort, sweep, query, lanes()}; }

}  // namespace ringfence::broad_phase::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace ringfence::broad_phase {
HWY_EXPORT(kernels);
Kernels choose_kernels() { return HWY_DYNAMIC_DISPATCH(kernels)(); }
}  // namespace ringfence::broad_phase
#endif
