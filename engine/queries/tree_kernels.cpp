#include "queries/tree_kernels.hpp"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "queries/tree_kernels.cpp"
#include <hwy/foreach_target.h>
// These must follow foreach_target.h, which includes this file once for each target.
#include "queries/filling-inl.hpp"
#include "queries/searching-inl.hpp"
#include "queries/streaming-inl.hpp"
#include "queries/touching-inl.hpp"

HWY_BEFORE_NAMESPACE();
namespace ringfence::queries::HWY_NAMESPACE {

TreeKernels tree_kernels() {
  return {fill_leaves, fill_nodes, reach_boxes, reach_all, near_boxes, near_all, list_touched};
}

}  // namespace ringfence::queries::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace ringfence::queries {
HWY_EXPORT(tree_kernels);
TreeKernels choose_tree_kernels() { return HWY_DYNAMIC_DISPATCH(tree_kernels)(); }
}  // namespace ringfence::queries
#endif
