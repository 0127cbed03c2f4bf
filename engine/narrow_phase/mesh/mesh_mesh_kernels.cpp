#include "narrow_phase/kernel.hpp"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "narrow_phase/mesh/mesh_mesh_kernels.cpp"
#include <hwy/foreach_target.h>
// After foreach_target.h.
#include "narrow_phase/mesh/mesh_mesh-inl.hpp"

HWY_BEFORE_NAMESPACE();
namespace ringfence::narrow_phase::HWY_NAMESPACE {

PairContact* mesh_mesh(const KernelInput& input, PairContact* out, KindCounters& counters) {
  for (const KernelPair& pair : input.pairs) {
    const Body& first = input.bodies[pair.first];
    const Body& second = input.bodies[pair.second];
    const geometry::ShapeRow& row = input.shapes.row(first.shape);
    const geometry::ShapeRow& other_row = input.shapes.row(second.shape);
    const MeshFrame frame(first.pose, second.pose);
    const double small = double{std::min(row.bounding_radius, other_row.bounding_radius)};
    const double sizes = double{row.bounding_radius} + double{other_row.bounding_radius};
    MeshPairWalk walk(input.shapes.mesh(row.index_in_kind).tree(), input.shapes.mesh(other_row.index_in_kind).tree(),
                      frame, bound_margin * sizes);
    const bool touches = walk.run();
    walk.work().add_to(counters);
    if (!touches) continue;
    const Penetration& penetration = walk.deepest().penetration();
    const Vec3d point = contact_point_of(penetration, walk.triangle(), {walk.other_triangle().corner, 3}, 0,
                                         feature_slack(small, sizes));
    *out++ = frame.contact(pair.pair, penetration, point, true);
  }
  return out;
}

}  // namespace ringfence::narrow_phase::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace ringfence::narrow_phase {

HWY_EXPORT(mesh_mesh);

PairContact* test_mesh_mesh(const KernelInput& input, PairContact* out, KindCounters& counters) {
  return HWY_DYNAMIC_DISPATCH(mesh_mesh)(input, out, counters);
}

}  // namespace ringfence::narrow_phase
#endif
